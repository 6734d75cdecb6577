"""The whole tick: pure, replayable, faithful to the trocar, and safe when the solver fails."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.priority.limits import speed_violations, violations
from robot.records import Case, Coordinates, Request, Safety, Solver
from robot.safety import Event
from tests import own_kinematics
from tests.robot.drive import DT, Drive, random_rotation, random_x, stood_still

SOLVERS = [
    (Solver.HQP, Coordinates.UV),
    (Solver.CLOSED_FORM, Coordinates.UV),
    (Solver.CLOSED_FORM, Coordinates.POLAR),
    (Solver.AUGMENTED, Coordinates.UV),
]


def disturb(drive: Drive, rng: np.random.Generator) -> Request:
    """Change the input as an operator, a leader and the world might; the request to make."""
    settings = drive.input["settings"]
    if rng.uniform() < 0.05:
        settings["case"] = rng.choice(list(Case))
        settings["solver"], settings["coordinates"] = SOLVERS[rng.integers(len(SOLVERS))]
        settings["feed_forward"] = rng.integers(2)
        settings["lock_rotation"], settings["lock_translation"] = rng.integers(2, size=2)
        settings["motion_scale"] = rng.uniform(0.05, 2.0)
    if rng.uniform() < 0.5:
        position = drive.input["leader"]["position"][0] + rng.uniform(-1e-3, 1e-3, 3)
        turn = Rotation.from_quat(drive.input["leader"]["wxyz"][0][[1, 2, 3, 0]])
        drive.lead(position, Rotation.from_rotvec(rng.uniform(-0.02, 0.02, 3)) * turn)
    if rng.uniform() < 0.01:
        drive.lead(rng.uniform(-1, 1, 3), random_rotation(rng))
    if rng.uniform() < 0.02:
        drive.let_go()
    if rng.uniform() < 0.1:
        return Request(int(rng.choice([1, 1, 1, 1, 2, 3, 4, 4, 5, 6])))
    return Request.NONE


def recorded(
    robot: InstrumentRobot, rng: np.random.Generator, ticks: int
) -> tuple[np.ndarray, list[np.ndarray], list[bytes]]:
    """First state, and input and outcome of every tick of a lively session."""
    drive = Drive(robot)
    first, inputs, outcomes = drive.state.copy(), [], []
    for _ in range(ticks):
        drive.tick(disturb(drive, rng))
        inputs.append(drive.input.copy())
        outcomes.append(drive.outcome.tobytes())
    return first, inputs, outcomes


def replayed(robot: InstrumentRobot, state: np.ndarray, inputs: list[np.ndarray]) -> list[bytes]:
    drive = Drive(robot)
    outcomes = []
    for tick_input in inputs:
        robot.tick(state, tick_input, drive.outcome)
        outcomes.append(drive.outcome.tobytes())
        state = drive.outcome["state"].copy()
    return outcomes


def test_a_recorded_session_replays_bit_for_bit(
    configuration: Configuration, robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    first, inputs, outcomes = recorded(robot, rng, 1500)
    moving = sum(
        np.frombuffer(one, Drive(robot).outcome.dtype)["command"]["moving"][0] for one in outcomes
    )
    assert moving > 300
    assert replayed(robot, first, inputs) == outcomes
    assert replayed(InstrumentRobot(configuration), first, inputs) == outcomes


def test_a_tick_changes_neither_state_nor_input_and_remembers_nothing(
    free_robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    robot = free_robot
    first, inputs, _ = recorded(robot, rng, 300)
    drive, other = Drive(robot), Drive(robot, random_x(robot, rng))
    other.engage(np.zeros(3))
    state = first
    for tick_input in inputs:
        before, asked = state.tobytes(), tick_input.tobytes()
        robot.tick(state, tick_input, drive.outcome)
        once = drive.outcome.tobytes()
        assert (state.tobytes(), tick_input.tobytes()) == (before, asked)
        other.lead(rng.uniform(-1e-3, 1e-3, 3))
        other.tick()
        robot.tick(state, tick_input, drive.outcome)
        assert drive.outcome.tobytes() == once
        state = drive.outcome["state"].copy()


@pytest.mark.parametrize("case", list(Case))
@pytest.mark.parametrize(("solver", "coordinates"), SOLVERS)
def test_a_lively_session_never_leaves_the_limits(
    free_robot: InstrumentRobot,
    rng: np.random.Generator,
    case: Case,
    solver: Solver,
    coordinates: Coordinates,
) -> None:
    robot, drive = free_robot, Drive(free_robot)
    settings = drive.input["settings"]
    settings["case"], settings["solver"], settings["coordinates"] = case, solver, coordinates
    drive.engage(np.zeros(3))
    position, rotation, pull = np.zeros(3), Rotation.identity(), np.zeros(3)
    for index in range(1200):
        if index % 150 == 0:
            pull, turn = 1e-4 * rng.normal(size=3), 2e-3 * rng.normal(size=3)
        position, rotation = position + pull, Rotation.from_rotvec(turn) * rotation
        drive.lead(position, rotation)
        outcome = drive.tick()
        assert drive.safety == Safety.ENABLED
        assert violations(drive.x, robot.parameters) == 0
        assert speed_violations(outcome["report"]["x_dot"], robot.parameters) == 0


def test_outcomes_are_the_state_in_other_words(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    drive = Drive(robot)
    for _ in range(300):
        outcome = drive.tick(disturb(drive, rng))
        state, report, command = outcome["state"], outcome["report"], outcome["command"]
        where = own_kinematics.pose_at(robot.configuration, state["x"])
        np.testing.assert_allclose(report["commanded_position"], where.tip, rtol=0, atol=1e-12)
        np.testing.assert_allclose(state["tip_rotation"], where.rotation, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(command["q"], state["x"][:7])
        np.testing.assert_array_equal(report["x"], state["x"])
        phi, delta = 0.5 * np.pi - report["theta"], report["delta"]
        uv = [phi * np.cos(delta), phi * np.sin(delta)]
        np.testing.assert_allclose(uv, state["x"][7:9], rtol=0, atol=1e-12)
        ratio = robot.configuration.instrument.tendon_pitch_radius_m / (
            robot.configuration.module.pulley_radius_m
        )
        u, v = state["x"][7:9]
        np.testing.assert_allclose(command["servo"], ratio * np.array([-u, v, u, -v]), atol=1e-15)


@pytest.mark.parametrize("engaged", [False, True])
@pytest.mark.parametrize("case", list(Case))
def test_a_moving_trocar_is_followed(robot: InstrumentRobot, engaged: bool, case: Case) -> None:
    """Breathing: 5 mm up and down and 2 mm aside, four seconds long; paper 1, section 2.3."""
    drive = Drive(robot)
    drive.input["settings"]["case"] = case
    trocar = np.array(robot.configuration.trocar.position_m)
    drive.enable()
    tip = drive.state["tip_position"][0].copy()
    if engaged:
        drive.lead(np.zeros(3))
    pulse = 2.0 * np.pi / 4.0
    depth = np.array([0.0, 0.002, 0.005])
    off, away = 0.0, 0.0
    for index in range(1, 2001):
        # The velocity is the mean over the tick, and the position the one at its beginning.
        now, after = (depth * np.sin(pulse * DT * k) for k in (index - 1, index))
        drive.input["trocar_position"] = trocar + now
        drive.input["trocar_velocity"] = (after - now) / DT
        outcome = drive.tick()
        assert outcome["command"]["moving"] == 1
        if index % 10 != 0:
            continue
        where = own_kinematics.pose_at(robot.configuration, drive.x)
        off = max(
            off,
            own_kinematics.distance_from_axis(trocar + after, where.shaft_base, where.shaft_end),
        )
        away = max(away, float(np.linalg.norm(where.tip - tip)))
    assert off < 0.005e-3
    assert away < 0.05e-3
    assert drive.safety == Safety.ENABLED


@pytest.mark.parametrize(
    "field", ["trocar_position", "trocar_velocity", "motion_scale", "lambda_reference", "dt_s"]
)
@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize(("solver", "coordinates"), SOLVERS)
def test_a_problem_that_is_not_made_of_numbers_is_a_fault_without_motion(
    robot: InstrumentRobot,
    field: str,
    value: float,
    solver: Solver,
    coordinates: Coordinates,
) -> None:
    drive = Drive(robot)
    settings = drive.input["settings"]
    settings["solver"], settings["coordinates"] = solver, coordinates
    drive.engage(np.zeros(3))
    drive.lead(np.array([1e-3, 0.0, 0.0]))
    drive.tick()
    drive.lead(np.array([2e-3, 0.0, 0.0]))
    if field in {"motion_scale", "lambda_reference"}:
        settings[field] = value
    else:
        drive.input[field] = value
    x = drive.x
    outcome = drive.tick()
    assert stood_still(outcome, x)
    assert drive.safety == Safety.FAULT
    assert drive.state["reason"][0] == Event.SOLVER_FAILED
    assert outcome["report"]["solver_status"] < 0


@pytest.mark.parametrize("case", list(Case))
def test_the_straight_segment_is_an_ordinary_point(robot: InstrumentRobot, case: Case) -> None:
    """Bending through straight, the rates neither jump nor stall."""
    x = robot.initial_state()["x"][0].copy()
    x[7:9] = 0.1, 0.0
    drive = Drive(robot, x)
    drive.input["settings"]["case"] = case
    drive.enable()
    tip = Rotation.from_matrix(drive.state["tip_rotation"][0])
    drive.lead(np.zeros(3), tip)
    drive.tick()
    before, largest_step, least, u = None, 0.0, np.inf, []
    for index in range(1, 601):
        angle = 0.2 * index / 600
        drive.lead(np.zeros(3), tip * Rotation.from_rotvec([0.0, -angle, 0.0]))
        rates = drive.tick()["report"]["x_dot"].copy()
        if before is not None:
            largest_step = max(largest_step, float(np.abs(rates - before).max()))
        least = min(least, float(np.linalg.norm(rates)))
        before = rates
        u.append(drive.x[7])
    assert min(np.abs(u)) < 2e-3
    assert u[0] > 0.05
    assert u[-1] < -0.05
    assert largest_step < 0.01
    assert least > 0.05


def test_no_engagement_and_a_resting_trocar_is_no_motion(drive: Drive) -> None:
    drive.enable()
    x = drive.x
    for _ in range(10):
        assert stood_still(drive.tick(), x)


def test_residuals_are_what_the_levels_could_not_do(free_robot: InstrumentRobot) -> None:
    """Pulled far beyond reach, the twist that is missing is reported and the RCM is not given."""
    drive = Drive(free_robot)
    drive.engage(np.zeros(3))
    reach = np.zeros(3)
    for _ in range(2500):
        reach[0] += 1.2e-4
        drive.lead(reach)
        outcome = drive.tick()
    report = outcome["report"]
    assert report["residual_linear"] > 0.01
    assert report["residual_rcm"] < 1e-6
    assert report["limits_active"] != 0
    assert drive.safety == Safety.ENABLED
