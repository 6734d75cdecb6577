"""What the drives are told where tensions are held: the balance, the modes, and no jump."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from robot.instrument_robot import InstrumentRobot
from robot.records import STATE, LeaderKind, Request, Safety
from robot.safety import Event
from robot.sensing.curvature_modes import MODES, ORDERS
from robot.sensing.tendon_work import tendon_forces
from robot.tendons import bend_from_servos, tendon_lengths
from robot.tension.records import TendonControl, TendonMode
from robot.tension.tendon_command import balance
from server.configuration_file import load
from tests.robot.drive import DT, Drive, with_steady_cells

POSITION, HYBRID, TENSION = TendonControl
LEVEL = 3.0
"""Co-contraction, N."""


@pytest.fixture(scope="module")
def robot() -> InstrumentRobot:
    return InstrumentRobot(with_steady_cells(load(None)))


class TautDrive(Drive):
    """A robot with torque cells, whose unit does what it is told at once.

    Attributes:
        unlike: (4,) N, by how much the tension of a tendon that holds a length differs from the
            model's.
    """

    def __init__(self, robot: InstrumentRobot) -> None:
        super().__init__(robot)
        self.unlike = np.zeros(4)
        self.input["tension_cells"] = 1
        self.input["measured_tension"] = 2.0
        self.input["settings"]["co_contraction"] = LEVEL
        self.measure(self.state["x"][0])

    def tick(self, request: Request = Request.NONE) -> np.void:
        self.obedient = False
        outcome = super().tick(request)
        command, state = outcome["command"], outcome["state"]
        self.input["measured_q"] = command["q"]
        self.input["measured_servo"] = command["servo"]
        if state["tendon_map"] == 1:
            told = state["tendon_tension"]
            lengths = command["tendon_mode"] == TendonMode.POSITION
            self.input["measured_tension"] = told + np.where(lengths, self.unlike, 0.0)
        return outcome

    def control(self, control: TendonControl) -> None:
        """From now on."""
        self.input["settings"]["tendon_control"] = control

    def blind(self, tendon: int, reading: float) -> None:
        """What the cell of that tendon says."""
        self.input["measured_tension"][0, tendon] = reading

    def rest(self, ticks: int) -> None:
        """Let time pass."""
        for _ in range(ticks):
            self.tick()

    def sway(self, ticks: int) -> list[np.ndarray]:
        """Lead the tip to and fro; outcomes."""
        outcomes = []
        for k in range(ticks):
            angle = 2.0 * np.pi * k / 600
            way = [0.006 * np.sin(angle), 0.008 * np.sin(2.0 * angle), 0.0]
            self.lead(np.array(way), kind=LeaderKind.API_POSE)
            self.tick()
            outcomes.append(self.outcome.copy())
        return outcomes


def state_at(u: float, v: float, friction: Any = 0.0, compensated: float = 1.0) -> np.ndarray:
    state = np.zeros(1, STATE)
    state["x"][0, 7:9] = u, v
    state["friction"], state["compensation"] = friction, compensated
    return state


def balanced(state: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    rows, right = np.empty((2, 4)), np.empty(2)
    balance(state[0], parameters, rows, right)
    return rows, right


@pytest.mark.parametrize("bend", [(0.0, 0.0), (0.7, -0.4), (-0.9, 0.33), (1.1, 0.8)])
def test_rows_are_the_lengths_differences(
    robot: InstrumentRobot, bend: tuple[float, float]
) -> None:
    p = robot.parameters[0]

    def lengths(u: float, v: float) -> np.ndarray:
        out = np.empty(4)
        tendon_lengths(u, v, p["pitch_radius"], out)
        return np.asarray(out - p["chord"] * p["pitch_radius"] * (u * u + v * v))

    rows, _ = balanced(state_at(*bend), robot.parameters)
    for k, step in enumerate(((1e-6, 0.0), (0.0, 1e-6))):
        ahead, behind = np.add(bend, step), np.subtract(bend, step)
        slope = (lengths(*ahead) - lengths(*behind)) / 2e-6
        np.testing.assert_allclose(rows[k], -slope, rtol=1e-7, atol=1e-12)


def test_the_balance_is_that_of_the_shape_estimate(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    """In constant curvature, with friction: the generalised forces of the lowest two modes."""
    parameters = robot.parameters.copy()
    parameters["capstan"], parameters["coulomb"] = 0.3, 0.2
    p = parameters[0]
    chord = p["chord"] * p["pitch_radius"]
    for _ in range(20):
        u, v = rng.uniform(-1.2, 1.2, 2)
        tension, share, level = rng.uniform(0.5, 9.0, 4), rng.uniform(-1.0, 1.0, 4), rng.uniform()
        rows, right = balanced(state_at(u, v, -share, level), parameters)
        z = np.zeros(MODES)
        z[0], z[ORDERS] = v, u
        force, slack = np.empty(MODES), np.empty(MODES)
        tendon_forces(
            z, tension, share, (0.3, 0.2, level), (p["pitch_radius"], p["segment_length"], chord),
            force, np.empty((MODES, MODES)), np.empty((MODES, 4)), np.empty((MODES, 4)), slack,
        )  # fmt: skip
        elastic = p["bending_stiffness"] / p["segment_length"] * np.array([u, v])
        made = rows @ tension - (right - elastic)
        np.testing.assert_allclose(made, [force[ORDERS], force[0]], rtol=1e-4, atol=1e-8)


def test_a_robot_that_holds_positions_is_told_what_it_always_was(robot: InstrumentRobot) -> None:
    plain, taut = Drive(robot), TautDrive(robot)
    for drive in (plain, taut):
        drive.engage(np.zeros(3))
    for k in range(300):
        for drive in (plain, taut):
            drive.lead(np.array([0.01 * np.sin(0.02 * k), 0.0, 0.0]))
            drive.tick()
        np.testing.assert_array_equal(
            plain.outcome["command"].view(np.float64), taut.outcome["command"].view(np.float64)
        )
    assert not taut.outcome["command"]["tendon_mode"].any()


def test_nothing_holds_tensions_where_nothing_measures_them(robot: InstrumentRobot) -> None:
    drive = Drive(robot)
    drive.input["settings"]["tendon_control"] = HYBRID
    drive.engage(np.zeros(3))
    assert not drive.outcome["command"]["tendon_mode"].any()
    assert not drive.outcome["state"]["tendon_bias"].any()


@pytest.mark.parametrize("control", [HYBRID, TENSION])
def test_the_least_tensions_that_hold_the_bend_are_held(
    robot: InstrumentRobot, control: TendonControl
) -> None:
    drive = TautDrive(robot)
    drive.control(control)
    drive.engage(np.zeros(3))
    seen = set()
    for outcome in drive.sway(1800)[900:]:
        state, command = outcome["state"][0], outcome["command"][0]
        modes = command["tendon_mode"]
        holds_tension = modes == TendonMode.TENSION
        if control == HYBRID:
            assert modes[0] + modes[2] == modes[1] + modes[3] == 1
            assert command["tension"].min() > LEVEL - 0.05
        else:
            assert holds_tension.all()
            assert command["tension"].min() > LEVEL - 0.2
        # Least: no pair is tighter than its looser tendon has to be.
        pairs = command["tension"].reshape(2, 2).min(axis=0)
        np.testing.assert_allclose(pairs, LEVEL, atol=0.2)
        rows, right = balanced(outcome["state"], robot.parameters)
        made = rows @ command["tension"] - right - state["force_bias"]
        # What a ramp of 10 N/s lags behind in tension control.
        assert np.abs(made).max() < (1e-9 if control == HYBRID else 2e-4)
        seen.add(tuple(modes))
    assert len(seen) == (2 if control == HYBRID else 1)


def test_beyond_the_limit_the_nearest_tensions_are_held(robot: InstrumentRobot) -> None:
    bound = InstrumentRobot(
        robot.configuration.model_copy(
            update={
                "tendons": robot.configuration.tendons.model_copy(update={"tension_limit_n": 3.5})
            }
        )
    )
    drive = TautDrive(bound)
    drive.control(TENSION)
    drive.engage(np.zeros(3))
    highest = max(outcome["command"]["tension"].max() for outcome in drive.sway(900))
    assert highest == pytest.approx(3.5)
    assert drive.safety == Safety.ENABLED


def test_no_command_jumps_whatever_is_switched_when(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    """A length begins where the tendon stands, a tension at the one that is measured."""
    drive = TautDrive(robot)
    drive.unlike = np.array([0.3, -0.2, 0.25, -0.35])
    drive.engage(np.zeros(3))
    step, rate = [], robot.configuration.tendons.tension_rate_n_s * DT
    controls = list(itertools.islice(itertools.cycle((HYBRID, TENSION, POSITION)), 60))
    switches = 0
    for k, control in enumerate(controls):
        drive.control(control)
        for j in range(int(rng.integers(15, 60))):
            angle = 0.01 * (40 * k + j)
            servo = drive.input["measured_servo"][0].copy()
            tension = drive.input["measured_tension"][0].copy()
            modes = drive.outcome["command"]["tendon_mode"][0].copy()
            drive.lead(np.array([0.006 * np.sin(angle), 0.008 * np.sin(1.7 * angle), 0.0]))
            drive.tick()
            command = drive.outcome["command"][0]
            changed = command["tendon_mode"] != modes
            switches += int(changed.sum())
            to_tension = changed & (command["tendon_mode"] == TendonMode.TENSION)
            assert np.abs(command["tension"] - tension)[to_tension].max(initial=0.0) <= rate + 1e-12
            lengths = command["tendon_mode"] == TendonMode.POSITION
            step.append(np.abs(command["servo"] - servo)[lengths].max(initial=0.0))
    assert switches > 60
    # A tip at 60 mm/s and 60 deg/s, and tendons that give way to 10 N/s.
    assert max(step) < np.radians(1.2)


def test_a_robot_at_rest_is_not_bent_by_being_enabled(robot: InstrumentRobot) -> None:
    """Its tendons are tightened; the lengths give way to just that."""
    drive = TautDrive(robot)
    drive.unlike = np.array([0.3, -0.2, 0.25, -0.35])
    drive.input["measured_tension"] = [2.4, 1.9, 2.2, 2.0]
    drive.control(HYBRID)
    drive.enable()
    p = robot.parameters[0]
    bend = drive.x[7:9]
    unlike = 0.6 / p["tendon_stiffness"] / p["pitch_radius"]
    for _ in range(400):
        drive.tick()
        np.testing.assert_array_equal(drive.x[7:9], bend)
        told = drive.outcome["state"]["tendon_tension"][0]
        stretch = (told - p["pretension"]) / p["tendon_stiffness"] / p["pulley_radius"]
        whole = drive.outcome["command"]["servo"][0] + stretch
        found = bend_from_servos(whole, p["pitch_radius"], p["pulley_radius"])
        # The bias is what tensions by length differ from the model in, as lengths.
        assert np.abs(np.subtract(found, bend)).max() < unlike
    loose = drive.outcome["command"]["tendon_mode"][0] == TendonMode.TENSION
    np.testing.assert_allclose(told[loose], LEVEL, atol=0.2)


@pytest.mark.parametrize("reading", [np.nan, 70.0, np.inf])
def test_a_blind_cell_pauses_and_the_tendons_stay(robot: InstrumentRobot, reading: float) -> None:
    drive = TautDrive(robot)
    drive.control(TENSION)
    drive.engage(np.zeros(3))
    drive.sway(50)
    drive.input["measured_servo"] += 0.01
    stood = drive.input["measured_servo"][0].copy()
    drive.blind(2, reading)
    drive.tick()
    assert drive.safety == Safety.PAUSED
    assert drive.state["reason"][0] == Event.TENSION_UNKNOWN
    command = drive.outcome["command"][0]
    assert not command["tendon_mode"].any()
    np.testing.assert_array_equal(command["servo"], stood)
    # Nobody goes on like that, but by lengths one may.
    drive.blind(2, reading)
    drive.tick(Request.ENABLE)
    assert drive.state["safety"][0] == Safety.PAUSED
    drive.control(POSITION)
    drive.blind(2, reading)
    drive.tick(Request.ENABLE)
    assert drive.state["safety"][0] == Safety.ENABLED
    np.testing.assert_allclose(drive.outcome["command"]["servo"][0], stood, atol=1e-12)


def test_what_tensions_became_meanwhile_does_not_move_who_goes_on(robot: InstrumentRobot) -> None:
    drive = TautDrive(robot)
    drive.control(HYBRID)
    drive.engage(np.zeros(3))
    drive.sway(50)
    drive.blind(2, np.nan)
    drive.tick()
    assert drive.safety == Safety.PAUSED
    stood = drive.outcome["command"]["servo"][0].copy()
    drive.let_go()
    drive.input["measured_tension"] = (5.0, 1.0, 4.0, 6.0)
    drive.tick(Request.ENABLE)
    assert drive.state["safety"][0] == Safety.ENABLED
    command = drive.outcome["command"][0]
    lengths = command["tendon_mode"] == TendonMode.POSITION
    assert lengths.sum() == 2
    np.testing.assert_allclose(command["servo"][lengths], stood[lengths], atol=1e-12)


def test_a_tendon_that_runs_away_is_a_fault(robot: InstrumentRobot) -> None:
    drive = TautDrive(robot)
    drive.control(HYBRID)
    drive.engage(np.zeros(3))
    drive.sway(50)
    loose = int(np.argmax(drive.outcome["command"]["tendon_mode"][0]))
    reach = 1e-3 * robot.configuration.tendons.travel_mm / robot.parameters["pulley_radius"][0]
    for share, safety in ((0.9, Safety.ENABLED), (1.1, Safety.FAULT)):
        drive.input["measured_servo"][0, loose] = (
            drive.state["tendon_servo"][0, loose] - share * reach
        )
        stood = drive.input["measured_servo"][0].copy()
        drive.tick()
        assert drive.safety == safety
    assert drive.state["reason"][0] == Event.TENDON_RUNS
    command = drive.outcome["command"][0]
    assert not command["tendon_mode"].any()
    assert command["servo"][loose] == stood[loose]


@pytest.mark.parametrize("request_", [Request.DISABLE, Request.EMERGENCY_STOP])
def test_who_does_not_drive_holds_lengths(robot: InstrumentRobot, request_: Request) -> None:
    drive = TautDrive(robot)
    drive.control(TENSION)
    drive.engage(np.zeros(3))
    drive.sway(50)
    stood = drive.input["measured_servo"][0].copy()
    for _ in range(20):
        drive.tick(request_)
        command = drive.outcome["command"][0]
        assert not command["tendon_mode"].any()
        np.testing.assert_array_equal(command["servo"], stood)


def test_a_paused_robot_goes_on_holding_tensions(robot: InstrumentRobot) -> None:
    drive = TautDrive(robot)
    drive.control(HYBRID)
    drive.engage(np.zeros(3))
    drive.sway(50)
    before = drive.outcome["command"].copy()
    drive.tick(Request.PAUSE)
    drive.rest(10)
    for field in ("servo", "tendon_mode", "tension"):
        np.testing.assert_array_equal(drive.outcome["command"][field], before[field])


def test_the_holding_tendon_changes_only_well_beyond_straight(robot: InstrumentRobot) -> None:
    drive = TautDrive(robot)
    drive.control(HYBRID)
    drive.enable()
    state = drive.state[0]
    holders = []
    for u in (0.2, 0.01, -0.01, -0.04, -0.06, -0.2, 0.04, 0.06):
        state["x"][7] = u
        drive.tick()
        state = drive.state[0]
        holders.append(int(drive.outcome["command"]["tendon_mode"][0, 0]))
    P, T = int(TendonMode.POSITION), int(TendonMode.TENSION)
    assert holders == [P, P, P, P, T, T, T, P]
