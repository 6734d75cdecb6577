"""How the desired pose runs after its target: speed, acceleration, and where it may not go."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import Refusal, Safety
from robot.teleoperation import limited_step
from tests.robot.drive import DT, Drive

ROUNDING = 1 + 1e-9
ACCELERATION = 5.0
REMAINDER_M = 0.126 * ACCELERATION * DT**2
"""A stop takes a whole number of ticks; by what is left over the target is passed, 2.5 um."""


def desired_positions(
    robot: InstrumentRobot, targets: np.ndarray, absolute: bool = False
) -> tuple[Drive, np.ndarray]:
    """The desired tip positions (n, 3), m, while a leader passes through ``targets`` (n, 3)."""
    drive = Drive(robot)
    drive.engage(targets[0])
    passed = []
    for target in targets:
        drive.lead(target, absolute=absolute)
        drive.tick()
        passed.append(drive.desired[0])
    return drive, np.array(passed)


def test_neither_speed_nor_acceleration_exceed_their_limits(
    free_robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    p = free_robot.parameters[0]
    jumps = np.repeat(rng.uniform(-4e-3, 4e-3, (25, 3)), 40, axis=0)
    jumps[0] = 0.0
    drive, passed = desired_positions(free_robot, jumps)
    assert drive.safety == Safety.ENABLED
    velocity = np.diff(passed, axis=0) / DT
    acceleration = np.diff(velocity, axis=0, prepend=np.zeros((1, 3))) / DT
    assert np.linalg.norm(velocity, axis=1).max() <= p["speed_max"] * ROUNDING
    assert np.linalg.norm(acceleration, axis=1).max() <= p["acceleration_max"] * (1 + 1e-6)


def test_turning_is_limited_likewise(free_robot: InstrumentRobot) -> None:
    p, drive = free_robot.parameters[0], Drive(free_robot)
    drive.engage(np.zeros(3))
    turns = []
    before = Rotation.from_matrix(drive.desired[1])
    for angle in np.repeat([0.2, -0.1, 0.15], 300):
        drive.lead(np.zeros(3), Rotation.from_rotvec([0.0, angle, 0.0]))
        drive.tick()
        now = Rotation.from_matrix(drive.desired[1])
        turns.append((now * before.inv()).as_rotvec() / DT)
        before = now
    rate = np.array(turns)
    change = np.diff(rate, axis=0, prepend=np.zeros((1, 3))) / DT
    assert np.linalg.norm(rate, axis=1).max() <= p["angular_speed_max"] * (1 + 1e-6)
    assert np.linalg.norm(change, axis=1).max() <= p["angular_acceleration_max"] * (1 + 1e-4)


@pytest.mark.parametrize("distance", [1e-6, 1e-4, 3e-3, 2e-2])
def test_a_resting_target_is_reached_and_hardly_passed(distance: float) -> None:
    position, velocity, step = np.zeros(3), np.zeros(3), np.empty(3)
    target = distance * np.array([0.6, 0.0, 0.8])
    for _ in range(600):
        step[:] = target - position
        limited_step(step, float(np.linalg.norm(step)), 0.0, velocity, DT, 0.06, ACCELERATION)
        position += step
        assert position @ target / distance <= distance + REMAINDER_M
    np.testing.assert_allclose(position, target, rtol=0, atol=1e-9)


def test_a_target_that_moves_within_the_limits_is_followed_at_once(
    free_robot: InstrumentRobot,
) -> None:
    """What is slow enough must not be filtered: a path's errors are counted against the path."""
    time = DT * np.arange(500)
    targets = np.zeros((500, 3))
    targets[:, 1] = 0.005 * (1.0 - np.cos(2.0 * np.pi * time))
    drive, passed = desired_positions(free_robot, targets)
    start = passed[0] - targets[0]
    np.testing.assert_allclose(passed - start, targets, rtol=0, atol=1e-9)
    assert drive.safety == Safety.ENABLED


@pytest.fixture(scope="module")
def guarded(configuration: Configuration) -> InstrumentRobot:
    """A robot that only its workspace holds back."""
    free = {"clearance_mm": -1000.0, "trocar_distance_mm": 1e6}
    limits = configuration.limits.model_copy(update=free)
    return InstrumentRobot(configuration.model_copy(update={"limits": limits}))


def pulled(robot: InstrumentRobot, step: np.ndarray, ticks: int) -> tuple[set[int], np.ndarray]:
    """What is said of targets that run away by ``step`` (3,) a tick, and the targets (n, 3), m."""
    drive = Drive(robot)
    drive.engage(np.zeros(3))
    said, targets = set(), []
    for index in range(1, ticks):
        drive.lead(index * step)
        said.add(int(drive.tick()["report"]["target_refused"]))
        targets.append(drive.state["target_position"][0].copy())
    assert drive.safety == Safety.ENABLED
    return said, np.array(targets)


@pytest.mark.parametrize(("axis", "sign"), [(0, 1), (0, -1), (1, 1), (1, -1), (2, -1)])
def test_no_target_leaves_the_workspace(guarded: InstrumentRobot, axis: int, sign: int) -> None:
    p, step = guarded.parameters[0], np.zeros(3)
    step[axis] = sign * 3e-4
    said, targets = pulled(guarded, step, 1400)
    assert (targets >= p["workspace_min"] - REMAINDER_M).all()
    assert (targets <= p["workspace_max"] + REMAINDER_M).all()
    assert said == {Refusal.NONE, Refusal.OUTSIDE_WORKSPACE}


def test_no_target_comes_from_behind_the_trocar(guarded: InstrumentRobot) -> None:
    wall = guarded.configuration.trocar.position_m[2]
    said, targets = pulled(guarded, np.array([0.0, 0.0, 3e-4]), 600)
    assert targets[:, 2].max() < wall
    assert said == {Refusal.NONE, Refusal.BEHIND_TROCAR}
