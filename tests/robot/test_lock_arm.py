"""With its arm locked the robot follows by the segment alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.instrument_robot import InstrumentRobot
from robot.priority.levels import CASE_NAMES
from robot.priority.limits import describe, lock_arm
from robot.records import Safety, Solver
from tests.robot.drive import DT, Drive


def test_only_the_segments_rates_keep_their_bounds(rng: np.random.Generator) -> None:
    lower, upper = -rng.uniform(0.1, 1.0, 10), rng.uniform(0.1, 1.0, 10)
    kept = lower[7:9].copy(), upper[7:9].copy()
    lock_arm(lower, upper)
    for bound, segment in zip((lower, upper), kept, strict=True):
        np.testing.assert_array_equal(bound[[0, 1, 2, 3, 4, 5, 6, 9]], 0.0)
        np.testing.assert_array_equal(bound[7:9], segment)


def locked(robot: InstrumentRobot, case: int = 1, solver: Solver = Solver.HQP) -> Drive:
    drive = Drive(robot)
    settings = drive.input["settings"]
    settings["lock_arm"], settings["case"], settings["solver"] = 1, case, solver
    drive.engage(np.zeros(3))
    return drive


def lead_on(drive: Drive, tick: int) -> None:
    angle = 2.0 * math.pi * tick * DT
    turn = Rotation.from_rotvec([0.1 * math.sin(angle), 0.3 * math.sin(angle), 0.0])
    drive.lead(np.array([0.003 * math.sin(angle), 0.004 * (1.0 - math.cos(angle)), 0.0]), turn)


@pytest.mark.parametrize("solver", list(Solver))
@pytest.mark.parametrize("case", range(len(CASE_NAMES)))
def test_joints_and_lambda_stand_still_to_the_last_bit(
    robot: InstrumentRobot, case: int, solver: Solver
) -> None:
    drive = locked(robot, case, solver)
    still = drive.x
    widest = 0.0
    for tick in range(150):
        lead_on(drive, tick)
        outcome = drive.tick()
        assert drive.safety == Safety.ENABLED
        np.testing.assert_array_equal(drive.x[:7], still[:7])
        assert drive.x[9] == still[9]
        np.testing.assert_array_equal(outcome["command"]["q"], still[:7])
        np.testing.assert_array_equal(outcome["report"]["x_dot"][[*range(7), 9]], 0.0)
        widest = max(widest, float(np.abs(drive.x[7:9] - still[7:9]).max()))
    if solver == Solver.HQP:
        assert widest > 0.02


def test_the_segment_goes_where_it_can_reach(robot: InstrumentRobot) -> None:
    """Asked to bend by 10 degrees about its own axis and where that leads, it does."""
    drive = locked(robot, 2)
    before = drive.state[0]["tip_rotation"].copy()
    axis = before[:, 1]
    drive.lead(np.zeros(3), Rotation.from_rotvec(math.radians(10.0) * axis))
    for _ in range(1000):
        drive.input["leader"]["age_s"] = 0.0
        drive.tick()
    turned = drive.state[0]["tip_rotation"] @ before.T
    angle = math.degrees(Rotation.from_matrix(turned).magnitude())
    assert angle == pytest.approx(10.0, abs=0.2)


def test_the_bend_limit_holds_with_a_locked_arm(robot: InstrumentRobot) -> None:
    drive = locked(robot, 2)
    axis = drive.state[0]["tip_rotation"][:, 1].copy()
    for tick in range(1500):
        angle = min(math.radians(60.0), tick * DT * math.radians(40.0))
        drive.lead(np.zeros(3), Rotation.from_rotvec(angle * axis))
        drive.tick()
        assert math.hypot(*drive.x[7:9]) <= robot.parameters[0]["bend_max"] + 1e-9
    assert math.hypot(*drive.x[7:9]) > 0.95 * robot.parameters[0]["bend_max"]


def test_a_joint_that_is_locked_is_not_said_to_be_at_its_limit(robot: InstrumentRobot) -> None:
    drive = locked(robot)
    for tick in range(50):
        lead_on(drive, tick)
        report = drive.tick()["report"]
        words = describe(int(report["limits_active"]), report["x"], robot.parameters)
        assert not [word for word in words if "joint" in word or "shaft" in word]


def test_an_unlocked_arm_moves_again(robot: InstrumentRobot) -> None:
    drive = locked(robot)
    for tick in range(50):
        lead_on(drive, tick)
        drive.tick()
    still = drive.x
    drive.input["settings"]["lock_arm"] = 0
    for tick in range(50, 100):
        lead_on(drive, tick)
        drive.tick()
    assert np.abs(drive.x[:7] - still[:7]).max() > 1e-4
