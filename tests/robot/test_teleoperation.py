"""From the leader's motion to the desired tip pose: clutch, scale, locks, view, speed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.instrument_robot import InstrumentRobot
from robot.records import Alignment, LeaderKind
from robot.teleoperation import follow
from tests.robot.drive import DT, Drive, random_rotation, stood_still

SETTLE_TICKS = 1500


def settle(drive: Drive) -> tuple[np.ndarray, Rotation]:
    """Where the desired pose runs to while the leader rests. The tip itself is not needed."""
    outcome = drive.outcome
    for _ in range(SETTLE_TICKS):
        assert follow(outcome, drive.input, drive.robot.parameters)
    drive.state = outcome["state"].copy()
    position, rotation = drive.desired
    return position, Rotation.from_matrix(rotation)


def engaged(drive: Drive, rng: np.random.Generator) -> tuple[np.ndarray, Rotation]:
    """Engage a leader that stands anywhere, seen from anywhere; its pose."""
    position, rotation = rng.uniform(-1, 1, 3), random_rotation(rng)
    view = random_rotation(rng)
    drive.input["settings"]["rotation_base_leader"] = view.as_matrix()
    drive.engage(position, rotation)
    return position, rotation


def small_move(rng: np.random.Generator) -> tuple[np.ndarray, Rotation]:
    """Less than the jump limits."""
    step = rng.normal(size=3)
    turn = rng.normal(size=3)
    step *= rng.uniform(0, 0.014) / np.linalg.norm(step)
    turn *= rng.uniform(0, 0.3) / np.linalg.norm(turn)
    return step, Rotation.from_rotvec(turn)


def homogeneous(rotation: Rotation, position: np.ndarray) -> np.ndarray:
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation.as_matrix(), position
    return transform


def by_the_paper(
    tip: np.ndarray, view: Rotation, anchor: np.ndarray, current: np.ndarray, scale: float
) -> np.ndarray:
    """Eqs. (88)-(91) with (4, 4) transforms, the similarity by the rotation part of (90) only."""
    moved = np.linalg.inv(anchor) @ current
    moved[:3, 3] *= scale
    similarity = np.linalg.inv(tip) @ homogeneous(view, np.array([0.3, -0.2, 0.5])) @ anchor
    similarity[:3, 3] = 0.0
    return np.asarray(tip @ similarity @ moved @ np.linalg.inv(similarity))


def test_closing_the_clutch_moves_nothing(robot: InstrumentRobot, rng: np.random.Generator) -> None:
    for _ in range(30):
        drive = Drive(robot)
        x, tip = drive.x, drive.state["tip_position"][0].copy()
        engaged(drive, rng)
        for _ in range(5):
            drive.tick()
        # The arm's elbow may slide to a better posture; instrument and tip stand still.
        np.testing.assert_allclose(drive.x[7:], x[7:], rtol=0, atol=1e-9)
        np.testing.assert_allclose(drive.state["tip_position"][0], tip, rtol=0, atol=1e-9)
        np.testing.assert_allclose(drive.desired[0], tip, rtol=0, atol=1e-9)


def test_the_mapping_is_equations_88_to_91(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    for _ in range(15):
        drive = Drive(robot)
        scale = rng.uniform(0.05, 2.0)
        drive.input["settings"]["motion_scale"] = scale
        position, rotation = engaged(drive, rng)
        view = Rotation.from_matrix(drive.input["settings"]["rotation_base_leader"][0])
        tip = homogeneous(Rotation.from_matrix(drive.desired[1]), drive.desired[0])
        step, turn = small_move(rng)
        drive.lead(position + step, turn * rotation)
        found, found_rotation = settle(drive)
        anchor = homogeneous(rotation, position)
        current = homogeneous(turn * rotation, position + step)
        expected = by_the_paper(tip, view, anchor, current, scale)
        np.testing.assert_allclose(found, expected[:3, 3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(found_rotation.as_matrix(), expected[:3, :3], rtol=0, atol=1e-12)


def test_the_motion_scale_acts_on_translation_only(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    step, turn = small_move(rng)
    moved, turned = [], []
    for scale in (0.05, 1.0, 2.0):
        drive = Drive(robot)
        drive.input["settings"]["motion_scale"] = scale
        drive.engage(np.zeros(3))
        before, _ = drive.desired
        drive.lead(step, turn)
        after, rotation = settle(drive)
        moved.append((after - before) / scale)
        turned.append(rotation.as_matrix())
    np.testing.assert_allclose(moved, np.broadcast_to(step, (3, 3)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(turned, [turned[0]] * 3, rtol=0, atol=1e-12)


def test_turning_the_leader_about_itself_never_moves_the_tip(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    """With the full transform of (90) it would swing by half a metre of lever."""
    for _ in range(10):
        drive = Drive(robot)
        position, rotation = engaged(drive, rng)
        before, rotation_before = drive.desired
        _, turn = small_move(rng)
        drive.lead(position, turn * rotation)
        after, rotation_after = settle(drive)
        np.testing.assert_allclose(after, before, rtol=0, atol=1e-12)
        angle = (rotation_after * Rotation.from_matrix(rotation_before).inv()).magnitude()
        assert angle == pytest.approx(turn.magnitude(), abs=1e-10)


def test_motion_is_mapped_through_the_operator_s_view(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    view = random_rotation(rng)
    for axis in np.eye(3):
        drive = Drive(robot)
        drive.input["settings"]["rotation_base_leader"] = view.as_matrix()
        drive.engage(np.zeros(3))
        before, rotation_before = drive.desired
        drive.lead(0.01 * axis, Rotation.from_rotvec(0.2 * axis))
        after, rotation_after = settle(drive)
        np.testing.assert_allclose(after - before, 0.01 * view.apply(axis), rtol=0, atol=1e-12)
        turn = rotation_after * Rotation.from_matrix(rotation_before).inv()
        np.testing.assert_allclose(turn.as_rotvec(), 0.2 * view.apply(axis), rtol=0, atol=1e-10)


@pytest.mark.parametrize("absolute", [False, True])
@pytest.mark.parametrize("lock", ["lock_rotation", "lock_translation"])
def test_what_is_locked_stays(
    robot: InstrumentRobot, rng: np.random.Generator, lock: str, absolute: bool
) -> None:
    for _ in range(5):
        drive = Drive(robot)
        drive.input["settings"][lock] = 1
        drive.enable()
        position = drive.state["tip_position"][0].copy()
        rotation = Rotation.from_matrix(drive.state["tip_rotation"][0])
        drive.lead(position, rotation, absolute=absolute)
        drive.tick()
        step, turn = small_move(rng)
        drive.lead(position + step, turn * rotation, absolute=absolute)
        after, rotation_after = settle(drive)
        angle = (rotation_after * rotation.inv()).magnitude()
        if lock == "lock_rotation":
            assert angle < 1e-12
            np.testing.assert_allclose(after, position + step, rtol=0, atol=1e-12)
        else:
            np.testing.assert_allclose(after, position, rtol=0, atol=1e-15)
            assert angle == pytest.approx(turn.magnitude(), abs=1e-10)


@pytest.mark.parametrize("change", ["scale", "view", "lock_rotation", "lock_translation"])
@pytest.mark.parametrize("settled", [False, True])
def test_changing_a_setting_mid_clutch_never_jumps(
    robot: InstrumentRobot, rng: np.random.Generator, change: str, settled: bool
) -> None:
    drive = Drive(robot)
    locked = change.startswith("lock")
    if locked:
        drive.input["settings"][change] = 1
    position, rotation = engaged(drive, rng)
    step, turn = small_move(rng)
    drive.lead(position + step, turn * rotation)
    drive.tick()
    if settled:
        settle(drive)
    before, rotation_before = drive.desired
    settings = drive.input["settings"]
    if locked:
        settings[change] = 0
    elif change == "scale":
        settings["motion_scale"] = 0.3
    else:
        settings["rotation_base_leader"] = random_rotation(rng).as_matrix()
    drive.lead(position + step, turn * rotation)
    after, rotation_after = settle(drive)
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotation_after.as_matrix(), rotation_before, rtol=0, atol=1e-13)


def test_the_desired_pose_keeps_the_speed_limits(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    p = robot.parameters[0]
    drive = Drive(robot)
    position, rotation = engaged(drive, rng)
    fastest = turning = 0.0
    for index in range(400):
        if index % 20 == 0:
            step, turn = small_move(rng)
            position, rotation = position + step, turn * rotation
            drive.lead(position, rotation)
        before, rotation_before = drive.desired
        drive.tick()
        after, rotation_after = drive.desired
        fastest = max(fastest, float(np.linalg.norm(after - before)) / DT)
        turn = Rotation.from_matrix(rotation_after @ rotation_before.T)
        turning = max(turning, turn.magnitude() / DT)
    assert fastest == pytest.approx(p["speed_max"], rel=1e-9)
    assert turning == pytest.approx(p["angular_speed_max"], rel=1e-9)


def test_smoothing_spreads_a_coarse_sample_over_time(robot: InstrumentRobot) -> None:
    drive = Drive(robot)
    drive.input["leader"]["smoothing_s"] = 0.02
    drive.engage(np.zeros(3))
    before, _ = drive.desired
    drive.lead(np.array([1e-4, 0.0, 0.0]))
    done = []
    for _ in range(30):
        drive.tick()
        done.append((drive.desired[0] - before)[0] / 1e-4)
    expected = 1.0 - np.exp(-DT / 0.02 * np.arange(1, 31))
    np.testing.assert_allclose(done, expected, rtol=0, atol=1e-9)


def test_another_leader_starts_with_zero_motion(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    drive = Drive(robot)
    drive.engage(np.zeros(3))
    before, _ = drive.desired
    drive.lead(rng.uniform(-1, 1, 3), random_rotation(rng), kind=LeaderKind.GIZMO)
    drive.tick()
    assert drive.state["engaged"][0] == 1
    assert drive.state["leader_kind"][0] == LeaderKind.GIZMO
    np.testing.assert_allclose(drive.desired[0], before, rtol=0, atol=1e-9)


def test_the_gizmo_moves_in_the_scene_whatever_the_operators_view(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    drive = Drive(robot)
    drive.input["settings"]["rotation_base_leader"] = random_rotation(rng).as_matrix()
    drive.enable()
    drive.lead(np.zeros(3), kind=LeaderKind.GIZMO)
    drive.tick()
    before, _ = drive.desired
    drive.lead(np.array([0.0, 1e-5, 0.0]), kind=LeaderKind.GIZMO)
    drive.tick()
    np.testing.assert_allclose(drive.desired[0] - before, [0.0, 1e-5, 0.0], rtol=0, atol=1e-12)


def test_matched_alignment_engages_only_a_leader_that_points_like_the_tip(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    tolerance = robot.parameters[0]["alignment_tolerance"]
    for share, expected in ((0.0, 1), (0.99, 1), (1.01, 0), (3.0, 0)):
        drive = Drive(robot)
        view = random_rotation(rng)
        drive.input["settings"]["alignment"] = Alignment.MATCHED
        drive.input["settings"]["rotation_base_leader"] = view.as_matrix()
        drive.enable()
        axis = rng.normal(size=3)
        turn = Rotation.from_rotvec(share * tolerance * axis / np.linalg.norm(axis))
        tip = Rotation.from_matrix(drive.state["tip_rotation"][0])
        drive.lead(np.zeros(3), view.inv() * turn * tip)
        x = drive.x
        outcome = drive.tick()
        assert drive.state["engaged"][0] == expected
        assert (outcome["report"]["target_refused"] == 0) == bool(expected)
        assert expected or stood_still(outcome, x)
