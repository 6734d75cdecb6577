"""The control loop in process: paths and the leaders around them."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.kinematic_plant import KinematicPlant
from robot.instrument_robot import InstrumentRobot
from robot.records import LeaderKind, Request, Safety
from scenes.path import Path
from server.configuration_file import load
from server.control.instrument_loop import InstrumentLoop


@pytest.fixture(scope="module")
def robot() -> InstrumentRobot:
    return InstrumentRobot(load())


@pytest.fixture
def loop(robot: InstrumentRobot) -> InstrumentLoop:
    """An enabled loop on the kinematic plant."""
    x = robot.initial_state()["x"][0]
    loop = InstrumentLoop(robot, KinematicPlant(robot.configuration, x), robot.configuration)
    loop.request = Request.ENABLE
    loop.step()
    return loop


def straight_path(millimetres: float, seconds: float) -> Path:
    rows = np.zeros((3, 8))
    rows[:, 0] = np.linspace(0.0, seconds, 3)
    rows[:, 1] = np.linspace(0.0, millimetres * 1e-3, 3)
    rows[:, 4] = 1.0
    return Path(rows, "straight")


def safety(loop: InstrumentLoop) -> Safety:
    return Safety(int(loop.record["outcome"]["state"]["safety"][0]))


def leave_an_old_sample(loop: InstrumentLoop) -> None:
    """The newest sample of a leader that stopped long ago, its clutch open."""
    loop.leader["kind"] = LeaderKind.API_POSE
    loop.leader["clutch"] = 0
    loop.leader["age_s"] = 60.0
    loop.leader["timeout_s"] = 0.025
    loop.leader["wxyz"] = (1.0, 0.0, 0.0, 0.0)


def test_the_end_of_a_path_is_not_a_stale_leader(loop: InstrumentLoop) -> None:
    leave_an_old_sample(loop)
    loop.start_path(straight_path(1.0, 0.1))
    for _ in range(100):
        loop.step()
    assert loop.path is None
    assert safety(loop) == Safety.ENABLED


def test_stopping_a_path_is_not_a_stale_leader(loop: InstrumentLoop) -> None:
    leave_an_old_sample(loop)
    loop.start_path(straight_path(5.0, 1.0))
    for _ in range(20):
        loop.step()
    loop.stop_path()
    for _ in range(5):
        loop.step()
    assert safety(loop) == Safety.ENABLED
    assert loop.record["outcome"]["command"]["moving"][0] == 0


@pytest.mark.parametrize("request_", [Request.PAUSE, Request.DISABLE, Request.EMERGENCY_STOP])
def test_a_path_does_not_outlive_the_enabled_state(loop: InstrumentLoop, request_: Request) -> None:
    loop.start_path(straight_path(5.0, 1.0))
    for _ in range(20):
        loop.step()
    loop.request = request_
    loop.step()
    assert loop.path is None
    stood = loop.record["truth"]["position"][0].copy()
    for request in (Request.RESET, Request.ENABLE):
        loop.request = request
        loop.step()
    for _ in range(20):
        loop.step()
    assert safety(loop) == Safety.ENABLED
    np.testing.assert_array_equal(loop.record["truth"]["position"][0], stood)


def test_the_errors_of_a_path_are_against_the_path_where_speed_limits_make_the_tip_lag(
    loop: InstrumentLoop,
) -> None:
    loop.start_path(straight_path(40.0, 0.4))
    steps = 100
    for _ in range(steps + 1):
        loop.step()
    asked = 40e-3 * steps * 0.002 / 0.4
    start = loop.robot.initial_state()["tip_position"][0]
    desired = loop.record["outcome"]["report"]["desired_position"][0]
    moved = loop.record["truth"]["position"][0] - start
    assert desired[0] - start[0] == pytest.approx(asked, rel=1e-6)
    speed_max = loop.robot.parameters[0]["speed_max"]
    assert moved[0] <= speed_max * 0.002 * (steps + 1) + 1e-6
    error = loop.record["truth"]["position_error"][0]
    assert error == pytest.approx(np.linalg.norm(desired - loop.record["truth"]["position"][0]))
    assert error > 1e-3


@pytest.mark.parametrize(
    ("connected", "arm", "locked"), [(True, "locked", 1), (True, "xarm", 0), (False, "locked", 0)]
)
def test_an_arm_that_is_locked_is_not_asked_to_move(connected: bool, arm: str, locked: int) -> None:
    """Whatever the operator's settings say, which always come without it."""
    configuration = load()
    hardware = configuration.hardware.model_copy(update={"connected": connected, "arm": arm})
    configuration = configuration.model_copy(update={"hardware": hardware})
    robot = InstrumentRobot(configuration)
    x = robot.initial_state()["x"][0]
    loop = InstrumentLoop(robot, KinematicPlant(configuration, x), configuration)
    loop.step()
    assert loop.record["input"]["settings"]["lock_arm"][0] == locked
