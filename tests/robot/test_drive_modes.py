"""What a leader drives: arm and segment together, or one of them alone (paper 1, section 3.1)."""

from __future__ import annotations

import numpy as np
import pytest

from robot.instrument_robot import InstrumentRobot
from robot.records import DriveMode, Safety
from tests.robot.drive import Drive

STEP = np.array([4e-5, 3e-5, -2e-5])


def driven(robot: InstrumentRobot, mode: DriveMode, ticks: int = 200) -> tuple[Drive, np.ndarray]:
    """A robot that was led in ``mode``, and where it was (10,) when that began."""
    drive = Drive(robot)
    drive.input["leader"]["mode"] = mode
    drive.engage(np.zeros(3))
    before = drive.x
    for index in range(1, ticks):
        drive.lead(index * STEP)
        drive.tick()
    assert drive.safety == Safety.ENABLED
    return drive, before


def test_the_arm_alone_leaves_the_segment_as_it_is(robot: InstrumentRobot) -> None:
    drive, before = driven(robot, DriveMode.ARM)
    np.testing.assert_array_equal(drive.x[7:9], before[7:9])
    assert np.abs(drive.x[:7] - before[:7]).max() > 1e-3


def test_the_segment_alone_leaves_the_arm_as_it_is(robot: InstrumentRobot) -> None:
    drive, before = driven(robot, DriveMode.SEGMENT)
    np.testing.assert_array_equal(drive.x[:7], before[:7])
    assert np.abs(drive.x[7:9] - before[7:9]).max() > 1e-3


def test_together_both_move(robot: InstrumentRobot) -> None:
    drive, before = driven(robot, DriveMode.BOTH)
    assert np.abs(drive.x[:7] - before[:7]).max() > 1e-4
    assert np.abs(drive.x[7:9] - before[7:9]).max() > 1e-4


@pytest.mark.parametrize("following", [DriveMode.ARM, DriveMode.SEGMENT])
def test_a_change_of_the_mode_moves_nothing(robot: InstrumentRobot, following: DriveMode) -> None:
    """What the leader has gone ahead of the tip is not made up for by the other part."""
    drive, _ = driven(robot, DriveMode.BOTH)
    leader = drive.input["leader"]
    for _ in range(100):
        drive.tick()
    held, x = leader["position"][0].copy(), drive.x
    leader["mode"] = following
    for _ in range(100):
        drive.lead(held)
        drive.tick()
    np.testing.assert_allclose(drive.x[:9], x[:9], rtol=0, atol=2e-4)
    assert drive.state["mode"][0] == following


def test_letting_go_forgets_the_mode(robot: InstrumentRobot) -> None:
    drive, _ = driven(robot, DriveMode.ARM)
    drive.let_go()
    drive.tick()
    assert drive.state["mode"][0] == DriveMode.BOTH
