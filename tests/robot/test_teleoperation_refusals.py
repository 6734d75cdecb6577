"""Leaders that must not lead: jumps, invalid poses, silence, a released hold, far targets."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.instrument_robot import InstrumentRobot
from robot.records import LeaderKind, Refusal, Safety
from robot.safety import Event
from tests.robot.drive import Drive, random_rotation, stood_still


def refused(drive: Drive, event: Event) -> None:
    """The next tick stands still and pauses for ``event``; new samples do not change that."""
    x = drive.x
    assert stood_still(drive.tick(), x)
    assert drive.safety == Safety.PAUSED
    assert drive.state["reason"][0] == event
    assert drive.state["engaged"][0] == 0
    drive.lead(np.zeros(3))
    assert stood_still(drive.tick(), x)


@pytest.mark.parametrize(("share", "jumps"), [(0.999, False), (1.001, True), (1e6, True)])
def test_a_jump_in_position_is_refused(
    robot: InstrumentRobot, rng: np.random.Generator, share: float, jumps: bool
) -> None:
    limit = robot.parameters[0]["jump_position"]
    for _ in range(5):
        drive, start = Drive(robot), rng.uniform(-1, 1, 3)
        drive.engage(start)
        direction = rng.normal(size=3)
        drive.lead(start + share * limit * direction / np.linalg.norm(direction))
        if jumps:
            refused(drive, Event.LEADER_JUMP)
        else:
            assert drive.tick()["command"]["moving"] == 1


@pytest.mark.parametrize(("share", "jumps"), [(0.999, False), (1.001, True), (9.0, True)])
def test_a_jump_in_orientation_is_refused(
    robot: InstrumentRobot, rng: np.random.Generator, share: float, jumps: bool
) -> None:
    limit = robot.parameters[0]["jump_angle"]
    for _ in range(5):
        drive, start = Drive(robot), random_rotation(rng)
        drive.engage(np.zeros(3), start)
        axis = rng.normal(size=3)
        turn = Rotation.from_rotvec(share * limit * axis / np.linalg.norm(axis))
        drive.lead(np.zeros(3), turn * start)
        if jumps:
            refused(drive, Event.LEADER_JUMP)
        else:
            assert drive.tick()["command"]["moving"] == 1


def test_the_opposite_quaternion_is_no_jump(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    for _ in range(10):
        rotation = random_rotation(rng)
        drives = [Drive(robot), Drive(robot)]
        for drive, sign in zip(drives, (1.0, -1.0), strict=True):
            drive.engage(np.zeros(3), rotation)
            drive.lead(np.array([1e-3, 0.0, 0.0]), rotation)
            drive.input["leader"]["wxyz"] *= sign
            drive.tick()
            assert drive.safety == Safety.ENABLED
        assert drives[0].outcome.tobytes() == drives[1].outcome.tobytes()


BAD_NUMBERS = (np.nan, np.inf, -np.inf)


@pytest.mark.parametrize("value", BAD_NUMBERS)
@pytest.mark.parametrize(("field", "size"), [("position", 3), ("wxyz", 4)])
@pytest.mark.parametrize("before_engaging", [False, True])
def test_a_pose_that_is_no_number_is_refused(
    robot: InstrumentRobot, field: str, size: int, value: float, before_engaging: bool
) -> None:
    for place in range(size):
        drive = Drive(robot)
        if before_engaging:
            drive.enable()
        else:
            drive.engage(np.zeros(3))
        drive.lead(np.array([1e-3, 0.0, 0.0]))
        drive.input["leader"][field][0, place] = value
        refused(drive, Event.LEADER_INVALID)


@pytest.mark.parametrize("length", [0.0, 1e-9])
@pytest.mark.parametrize("absolute", [False, True])
def test_a_zero_quaternion_is_refused(
    robot: InstrumentRobot, length: float, absolute: bool
) -> None:
    drive = Drive(robot)
    drive.enable()
    drive.lead(drive.state["tip_position"][0], absolute=absolute)
    drive.tick()
    drive.input["leader"]["wxyz"] = [length, 0.0, 0.0, 0.0]
    refused(drive, Event.LEADER_INVALID)


@pytest.mark.parametrize("age", [0.1001, 1e9, np.nan])
def test_a_leader_that_goes_silent_while_driving_pauses(robot: InstrumentRobot, age: float) -> None:
    drive = Drive(robot)
    drive.engage(np.zeros(3))
    drive.lead(np.array([2e-3, 0.0, 0.0]))
    drive.tick()
    drive.input["leader"]["age_s"] = age
    x = drive.x
    assert stood_still(drive.tick(), x)
    assert drive.safety == Safety.PAUSED
    assert drive.state["reason"][0] == Event.LEADER_STALE


def test_an_old_sample_within_its_time_drives_on(drive: Drive) -> None:
    drive.engage(np.zeros(3))
    drive.lead(np.array([2e-3, 0.0, 0.0]))
    drive.input["leader"]["age_s"] = 0.0999
    assert drive.tick()["command"]["moving"] == 1


def test_a_leader_that_let_go_may_be_silent(drive: Drive) -> None:
    drive.engage(np.zeros(3))
    drive.lead(np.array([2e-3, 0.0, 0.0]))
    drive.tick()
    drive.let_go()
    drive.input["leader"]["age_s"] = 1e9
    x = drive.x
    assert stood_still(drive.tick(), x)
    assert drive.safety == Safety.ENABLED
    assert drive.state["engaged"][0] == 0


def test_a_leader_that_was_silent_before_engaging_does_not_engage(drive: Drive) -> None:
    drive.enable()
    drive.lead(np.zeros(3))
    drive.input["leader"]["age_s"] = 5.0
    x = drive.x
    assert stood_still(drive.tick(), x)
    assert drive.safety == Safety.ENABLED
    assert drive.state["engaged"][0] == 0


def test_releasing_the_hold_stops_and_leaves_the_robot_enabled(drive: Drive) -> None:
    drive.input["settings"]["hold_to_move"] = 1
    drive.input["hold"] = 1
    drive.engage(np.zeros(3))
    drive.lead(np.array([0.0, 5e-3, 0.0]))
    assert drive.tick()["command"]["moving"] == 1
    drive.input["hold"] = 0
    x = drive.x
    for _ in range(3):
        outcome = drive.tick()
        assert stood_still(outcome, x)
        assert outcome["report"]["target_refused"] == Refusal.HOLD_NOT_PRESSED
    assert drive.safety == Safety.ENABLED
    # Pressed again, it goes on from here, not to where the leader has gone meanwhile.
    drive.lead(np.array([0.3, 0.3, 0.3]))
    drive.input["hold"] = 1
    before, _ = drive.desired
    for _ in range(5):
        drive.tick()
    assert drive.state["engaged"][0] == 1
    np.testing.assert_allclose(drive.desired[0], before, rtol=0, atol=1e-9)


def test_opening_the_clutch_stops_and_the_leader_may_go_elsewhere(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    drive = Drive(robot)
    drive.engage(np.zeros(3))
    drive.lead(np.array([0.0, 5e-3, 0.0]))
    drive.tick()
    drive.let_go()
    x = drive.x
    assert stood_still(drive.tick(), x)
    drive.lead(rng.uniform(-1, 1, 3), random_rotation(rng))
    before, _ = drive.desired
    drive.tick()
    assert drive.safety == Safety.ENABLED
    np.testing.assert_allclose(drive.desired[0], before, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("share", "engages"), [(0.99, 1), (1.01, 0)])
def test_a_target_too_far_away_is_refused(
    robot: InstrumentRobot, share: float, engages: int
) -> None:
    drive = Drive(robot)
    drive.enable()
    far = share * robot.parameters[0]["target_distance"]
    target = drive.state["tip_position"][0] + [0.0, far, 0.0]
    rotation = Rotation.from_matrix(drive.state["tip_rotation"][0])
    drive.lead(target, rotation, kind=LeaderKind.API_TARGET, absolute=True)
    x = drive.x
    outcome = drive.tick()
    assert drive.state["engaged"][0] == engages
    if not engages:
        assert stood_still(outcome, x)
        assert outcome["report"]["target_refused"] == Refusal.TARGET_TOO_FAR
        assert drive.safety == Safety.ENABLED


@pytest.mark.parametrize("safety", [Safety.DISABLED, Safety.PAUSED, Safety.FAULT])
def test_no_leader_leads_a_robot_that_is_not_enabled(
    robot: InstrumentRobot, rng: np.random.Generator, safety: Safety
) -> None:
    drive = Drive(robot)
    drive.state["safety"] = safety
    x = drive.x
    for _ in range(5):
        drive.lead(rng.uniform(-1, 1, 3), random_rotation(rng))
        assert stood_still(drive.tick(), x)
        assert drive.state["engaged"][0] == 0
    assert drive.safety == safety
