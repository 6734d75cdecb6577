"""The physics plant: directions, beam theory, stretch, friction, repeatability, and a blow-up."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from hardware.kinematic_plant import KinematicPlant
from hardware.physics.model import NITI_MODULUS_PA
from hardware.physics.plant import PhysicsPlant
from hardware.physics.preset import IDEAL, PAPER, PRESETS
from hardware.plant import Plant
from robot.instrument_robot import InstrumentRobot
from robot.records import Request, Safety
from robot.safety import Event
from scenes.boards.board import board
from server.control.instrument_loop import InstrumentLoop
from tests import own_kinematics
from tests.hardware import physics_robot as here

RIGHT_ANGLE = 0.5 * math.pi
LENGTH, PITCH, DISKS = 0.030, 0.0018, 12


def straight_plant(kind: str) -> Plant:
    x = here.standing_straight()
    if kind == "kinematic":
        return KinematicPlant(here.configuration(), x)
    return here.physics(kind, x=x)


def lean(plant: Plant) -> np.ndarray:
    """(2,) where the tip stands beside the shaft, in the segment's frame, m."""
    found = here.truth(plant)
    shaft = here.expected(found).rotation @ np.linalg.inv(
        own_kinematics.segment(
            RIGHT_ANGLE - np.hypot(*found["uv"]), math.atan2(*found["uv"][::-1]), LENGTH
        )[1]
    )
    local: np.ndarray = shaft.T @ (found["position"] - found["shaft_end"])
    return local[:2]


@pytest.mark.parametrize("kind", ["kinematic", "ideal", "paper", "harsh"])
@pytest.mark.parametrize(
    ("uv", "towards"),
    [((1, 0), (1, 0)), ((-1, 0), (-1, 0)), ((0, 1), (0, -1)), ((0, -1), (0, 1))],
)
def test_every_sign_leans_the_same_way_on_every_plant(
    kind: str, uv: tuple[int, int], towards: tuple[int, int]
) -> None:
    plant = straight_plant(kind)
    for _ in range(60):
        plant.write(here.command(here.start()[:7], here.servos(0.6 * uv[0], 0.6 * uv[1])))
        for _ in range(5):
            plant.advance()
    offset = lean(plant)
    assert offset @ towards > 0.005
    assert abs(offset @ [towards[1], -towards[0]]) < 0.1 * (offset @ towards)
    assert here.truth(plant)["uv"] @ uv > 0.4
    tension = plant.read().tension
    if kind != "kinematic":
        pulled = {(1, 0): 0, (-1, 0): 2, (0, 1): 3, (0, -1): 1}[uv]
        assert int(np.argmax(tension)) == pulled


def play(plant: PhysicsPlant, seconds: float) -> bytes:
    """Everything it measures and is, tick by tick, under a motion of arm and segment."""
    seen = bytearray()
    for index in range(round(seconds / here.DT)):
        share = math.sin(2.0 * math.pi * index * here.DT)
        q = here.start()[:7] + 0.002 * share
        plant.write(here.command(q, here.servos(1.0 + 0.7 * abs(share), 0.1 * share)))
        plant.advance()
        now = plant.read()
        assert not now.event
        for part in (now.q, now.servo, now.tension, now.tracker, here.truth(plant)):
            seen += part.tobytes()
    return bytes(seen)


def test_the_same_seed_and_commands_are_the_same_to_the_last_bit_in_contact_too() -> None:
    plants = [here.physics("paper", seed, here.obstacle(ring=True)) for seed in (5, 5, 6)]
    first, second, other = (play(plant, 0.6) for plant in plants)
    assert here.truth(plants[0])["rings_touched"] == 1
    assert first == second
    assert first != other


def test_a_ball_in_its_groove_is_as_repeatable() -> None:
    under = here.configuration("paper", 3)
    boards = [board("silicon-sine", under) for _ in range(2)]
    runs = [play(PhysicsPlant(under, here.start(), one), 0.3) for one in boards]
    assert runs[0] == runs[1]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_released_segment_bends_as_a_cantilever(axis: int, sign: float) -> None:
    """P L^3 / 3 E I, against the same without the force."""
    plant = here.physics("paper", x=here.standing_straight())
    plant.release()
    here.wait(plant, 0.5)
    before = lean(plant)
    radius = 0.5 * PAPER.backbone_diameter_m
    inertia = 0.25 * math.pi * radius**4
    deflection = 0.0005
    force = sign * 3.0 * NITI_MODULUS_PA * inertia * deflection / LENGTH**3
    found = here.truth(plant)
    frame = here.rotation(found["wxyz"])
    push = force * frame[:, axis]
    lever = 0.5 * LENGTH / DISKS * frame[:, 2]
    place = mujoco.mj_name2id(plant._model, mujoco.mjtObj.mjOBJ_BODY, f"disk{DISKS}")
    plant._data.xfrc_applied[place] = [*push, *np.cross(lever, push)]
    here.wait(plant, 0.5)
    moved = lean(plant) - before
    assert sign * moved[axis] == pytest.approx(deflection, rel=0.015)
    assert abs(moved[1 - axis]) < 0.02 * deflection


def test_a_released_segment_springs_straight_and_is_taken_hold_of_again() -> None:
    plant = here.physics("paper")
    plant.release()
    here.wait(plant, 0.5)
    assert np.hypot(*here.bend_deg(plant)) < 1.5
    plant.hold()
    here.wait(plant, 0.5)
    assert here.bend_deg(plant)[0] > 50.0


def test_tendons_stretch_as_measured_on_the_prototype() -> None:
    plant = here.physics("paper", x=here.standing_straight())
    here.bend(plant, RIGHT_ANGLE, 0.0, 1.5)
    assert here.bend_deg(plant)[0] == pytest.approx(84.0, abs=1.5)


def test_stiff_tendons_leave_only_their_straight_way_between_disks() -> None:
    """Told 90 degrees, a chain of n disks is short of it by L phi^2 / 8 n^2 over the radius."""
    plant = here.physics("ideal", x=here.standing_straight())
    here.bend(plant, RIGHT_ANGLE, 0.0, 1.5)
    reached = math.radians(here.bend_deg(plant)[0])
    told = reached + LENGTH * reached**2 / (8.0 * DISKS**2 * PITCH)
    assert math.degrees(told) == pytest.approx(90.0, abs=0.3)
    assert math.degrees(reached) > 87.5


@pytest.mark.parametrize("preset", list(PRESETS))
def test_friction_holds_without_creeping(preset: str) -> None:
    plant = here.physics(preset, x=here.standing_straight())
    here.bend(plant, 0.7, -0.4, 0.7)
    before = here.bend_deg(plant)
    here.wait(plant, 5.0)
    np.testing.assert_allclose(here.bend_deg(plant), before, rtol=0, atol=0.05)


def difference_to_and_fro(preset: str, axis: int) -> float:
    """By how much the bend lags behind, deg, at the same command from either side."""
    plant, far = here.physics(preset, x=here.standing_straight()), np.zeros(2)
    reached = []
    for sign in (1.0, -1.0):
        far[axis] = sign
        here.bend(plant, float(far[0]), float(far[1]), 0.8)
        here.bend(plant, 0.0, 0.0, 0.8)
        reached.append(here.bend_deg(plant)[axis])
    return float(reached[0] - reached[1])


@pytest.mark.parametrize("axis", [0, 1])
def test_friction_makes_a_hysteresis_of_the_size_that_was_calibrated(axis: int) -> None:
    """Full friction holds back by some 2 degrees; to and fro differ by twice that."""
    assert 2.5 < difference_to_and_fro("paper", axis) < 6.0
    assert abs(difference_to_and_fro("ideal", axis)) < 0.01


def test_tendons_pull_only() -> None:
    plant = here.physics("harsh", x=here.standing_straight())
    smallest = np.inf
    for index in range(1000):
        angle = 2.0 * math.pi * index * here.DT
        plant.write(
            here.command(
                here.start()[:7], here.servos(1.5 * math.sin(angle), 1.2 * math.cos(3.0 * angle))
            )
        )
        plant.advance()
        smallest = min(smallest, plant.read().tension.min())
        assert plant.read().tension.max() < 50.0
    assert smallest == 0.0  # one of them did go slack, and did not push


def test_a_straight_segment_is_held_by_its_pretension() -> None:
    tension = here.physics("paper", x=here.standing_straight()).read().tension
    np.testing.assert_allclose(tension, PAPER.pretension_n, rtol=0.25)


@pytest.mark.parametrize("preset", list(PRESETS))
def test_the_tip_is_where_the_drawings_say_but_for_the_presets_errors(
    preset: str, rng: np.random.Generator
) -> None:
    """The chain of links against constant curvature, at the true joints and bend."""
    plant = here.physics(preset, x=here.standing_straight())
    allowed = {"ideal": (0.1e-3, 0.2), "paper": (0.5e-3, 0.3), "harsh": (4e-3, 1.0)}[preset]
    for _ in range(5):
        phi, delta = rng.uniform(0.0, 1.5), rng.uniform(-math.pi, math.pi)
        here.bend(plant, phi * math.cos(delta), phi * math.sin(delta), 0.5, 0.2)
        found = here.truth(plant)
        drawn = here.expected(found)
        assert np.linalg.norm(found["position"] - drawn.tip) < allowed[0]
        off = own_kinematics.angle_between(here.rotation(found["wxyz"]), drawn.rotation)
        assert math.degrees(off) < allowed[1]
        for end in ("shaft_base", "shaft_end"):
            assert np.linalg.norm(found[end] - getattr(drawn, end)) < allowed[0]


def test_a_robot_of_the_paper_preset_is_not_as_drawn() -> None:
    found = here.truth(here.physics("paper"))
    assert np.linalg.norm(found["position"] - here.expected(found).tip) > 0.05e-3
    ideal = here.truth(here.physics("ideal"))
    assert np.linalg.norm(ideal["shaft_end"] - here.expected(ideal).shaft_end) < 1e-8


def test_a_board_is_changed_under_a_robot_that_stays_as_it_is() -> None:
    plant = here.physics("paper")
    here.bend(plant, 0.4, 0.3, 0.5, 0.2)
    before, measured = here.truth(plant), plant.read().q.copy()
    for one in ("ring-board", "silicon-arc", "none"):
        plant.change_board(board(one, here.configuration()))
        after = here.truth(plant)
        np.testing.assert_array_equal(plant.read().q, measured)
        np.testing.assert_allclose(after["uv"], before["uv"], rtol=0, atol=1e-12)
        np.testing.assert_allclose(after["position"], before["position"], rtol=0, atol=1e-9)
    here.wait(plant, 0.5)
    np.testing.assert_allclose(here.truth(plant)["uv"], before["uv"], rtol=0, atol=1e-3)


@pytest.mark.parametrize("along", [0.2, 0.4, 0.9])
def test_a_trocar_on_the_shaft_is_truly_on_the_true_shaft(along: float) -> None:
    plant = here.physics("harsh")
    found = here.truth(plant)
    base, end = found["shaft_base"], found["shaft_end"]
    told = base + along * (end - base) + np.array([0.0, 0.002, 0.001])
    plant.register_trocar(told)
    record = np.zeros(1, found.dtype)
    record["trocar_position"] = told
    plant.truth(record)
    true = record["trocar_position"][0]
    assert own_kinematics.distance_from_axis(true, base, end) < 1e-9
    assert abs((true - told) @ (end - base)) < 1e-12


def test_a_trocar_that_the_tip_touched_is_where_the_true_tip_was() -> None:
    plant = here.physics("harsh")
    found = here.truth(plant)
    told = found["position"] + np.array([0.001, -0.002, 0.0005])
    plant.register_trocar(told)
    here.bend(plant, 0.3, 0.0, 0.5)
    record = np.zeros(1, found.dtype)
    record["trocar_position"] = told
    plant.truth(record)
    np.testing.assert_allclose(record["trocar_position"][0], found["position"], rtol=0, atol=1e-12)


def spoil(plant: PhysicsPlant, what: str) -> None:
    """Let the engine's state be what no state should be."""
    getattr(plant._data, what.split(maxsplit=1)[0])[9] = math.nan if what.endswith("nan") else 1e15


@pytest.mark.parametrize("what", ["qvel nan", "qvel huge", "qpos nan"])
@pytest.mark.parametrize("fresh", [False, True])
def test_a_simulation_that_blows_up_is_noticed_and_stands_still(
    what: str, fresh: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also in the very first step before a new board, when the engine's clock has just begun."""
    monkeypatch.chdir(tmp_path)
    plant = here.physics("paper")
    here.wait(plant, 0.1)
    if fresh:
        plant.change_board(board("ring-board", here.configuration()))
    before, standing = plant.read(), here.truth(plant)
    q, servo = before.q.copy(), before.servo.copy()
    assert not before.event
    spoil(plant, what)
    assert plant.advance() == plant.spec.tick_ns
    assert plant.read().event
    for _ in range(20):
        plant.write(here.command(q + 0.1, servo + 0.1))
        assert plant.advance() == plant.spec.tick_ns
        now = plant.read()
        assert now.event
        np.testing.assert_array_equal(now.q, q)
        np.testing.assert_array_equal(now.servo, servo)
        assert here.truth(plant).tobytes() == standing.tobytes()


def test_a_blow_up_is_told_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    plant = here.physics("paper")
    spoil(plant, "qvel nan")
    plant.advance()
    assert "simulation: Nan, Inf or huge value" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("request_first", [Request.ENABLE, Request.NONE])
def test_a_blow_up_is_a_fault_of_the_loop(
    request_first: Request, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    under = here.configuration("paper")
    robot = InstrumentRobot(under)
    plant = PhysicsPlant(under, here.start(), here.NO_BOARD)
    loop = InstrumentLoop(robot, plant, under)
    loop.request = request_first
    for _ in range(5):
        loop.step()
    spoil(plant, "qvel nan")
    for _ in range(3):
        loop.step()
    state = loop.record["outcome"]["state"][0]
    assert Safety(int(state["safety"])) == Safety.FAULT
    assert int(state["reason"]) == Event.SIMULATION_FAILED
    assert loop.record["outcome"]["command"]["moving"][0] == 0
    loop.request = Request.RESET
    for _ in range(2):
        loop.step()
    assert loop.safety == Safety.FAULT


def test_presets_are_ordered_from_good_to_bad() -> None:
    for good, bad in itertools.pairwise(PRESETS.values()):
        assert good.tendon_friction_n < bad.tendon_friction_n
        assert good.servo_lag_s < bad.servo_lag_s
        assert all(a < b for a, b in zip(good.joint_lag_s, bad.joint_lag_s, strict=True))
        assert all(
            a > b
            for a, b in zip(good.joint_stiffness_nm_rad, bad.joint_stiffness_nm_rad, strict=True)
        )
    assert IDEAL.spread == IDEAL.payload_error == IDEAL.origin_error_m == 0.0
