"""Distances between arm, module, shaft and wall, and what too little of them leads to."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from robot.arm import Arm
from robot.clearance import EVERY_TICKS, PART_NAMES, Part, segment_distance, wall_distance
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import Request, Safety
from robot.safety import Event
from tests import own_kinematics
from tests.robot.drive import Drive, random_x

MARGIN_M = 0.002


def test_the_distance_of_two_lines_is_the_smallest_there_is(rng: np.random.Generator) -> None:
    for _ in range(40):
        a, b, c, d = rng.normal(size=(4, 3))
        found = segment_distance(a, b, c, d)

        def between(
            at: np.ndarray,
            a: np.ndarray = a,
            b: np.ndarray = b,
            c: np.ndarray = c,
            d: np.ndarray = d,
        ) -> float:
            return float(np.sum((a + at[0] * (b - a) - c - at[1] * (d - c)) ** 2))

        best = min(
            minimize(between, start, bounds=[(0, 1), (0, 1)]).fun
            for start in ((0.5, 0.5), (0.0, 1.0), (1.0, 0.0))
        )
        assert found == pytest.approx(np.sqrt(best), abs=1e-6)
        assert found == pytest.approx(segment_distance(d, c, b, a), abs=1e-12)


@pytest.mark.parametrize("length", [0.0, 1e-12])
def test_lines_without_length_are_points(length: float, rng: np.random.Generator) -> None:
    a, c = rng.normal(size=(2, 3))
    along = np.array([length, 0.0, 0.0])
    distance = pytest.approx(np.linalg.norm(a - c), abs=1e-9)
    assert segment_distance(a, a + along, c, c + along) == distance


def test_the_wall_is_a_plate(parameters: np.ndarray) -> None:
    centre, p = np.array([0.4, 0.0, 0.12]), parameters[0]
    half, radius = 0.5 * float(p["wall_thickness"]), float(p["wall_radius"])
    normal = p["wall_normal"]
    for height in (0.1, 0.02, -0.03):
        over = centre + height * normal
        assert wall_distance(over, centre, p) == pytest.approx(height - half, abs=1e-12)
    aside = centre + np.array([radius + 0.03, 0.0, half + 0.04])
    assert wall_distance(aside, centre, p) == pytest.approx(0.05, abs=1e-12)


def test_placing_the_arm_leaves_what_it_computed(arm: Arm, rng: np.random.Generator) -> None:
    here, there = rng.uniform(-1, 1, (2, 7))
    arm.update(here)
    before = arm.position.copy(), arm.rotation.copy(), arm.jacobian.copy()
    joints, rotation = np.full((8, 3), 9.0), np.empty((3, 3))
    joints[0] = 0.0
    arm.place(there, joints, rotation)
    for kept, now in zip(before, (arm.position, arm.rotation, arm.jacobian), strict=True):
        np.testing.assert_array_equal(kept, now)
    own = own_kinematics.flange(there)
    np.testing.assert_allclose(joints[7], own[:3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(rotation, own[:3, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(joints[1], [0.0, 0.0, 0.267], rtol=0, atol=1e-12)


def test_the_measured_shaft_is_what_counts(
    free_robot: InstrumentRobot, configuration: Configuration, rng: np.random.Generator
) -> None:
    for _ in range(20):
        x = random_x(free_robot, rng)
        drive = Drive(free_robot, x)
        for _ in range(EVERY_TICKS):
            drive.tick()
        where = own_kinematics.pose_at(configuration, x)
        trocar = np.array(configuration.trocar.position_m)
        along = where.shaft_end - where.shaft_base
        away = np.linalg.norm(np.cross(along, trocar - where.shaft_base)) / np.linalg.norm(along)
        assert drive.state["trocar_distance"][0] == pytest.approx(away, abs=1e-9)


def test_every_pair_has_a_name() -> None:
    assert set(PART_NAMES) == set(Part)


def brought_near(robot: InstrumentRobot, clearance: float) -> Drive:
    """An enabled robot whose measured clearance is said to be ``clearance``, m."""
    drive = Drive(robot)
    drive.enable()
    drive.state["clearance"] = clearance
    return drive


def test_too_little_clearance_pauses_and_moving_away_is_possible(robot: InstrumentRobot) -> None:
    limit = robot.configuration.limits.clearance_mm * 1e-3
    drive = brought_near(robot, limit - MARGIN_M)
    drive.tick()
    assert (drive.safety, drive.state["reason"][0]) == (Safety.PAUSED, Event.CLEARANCE)
    drive.state["clearance"] = limit - MARGIN_M
    drive.tick(Request.ENABLE)
    drive.state["clearance"] = limit - 0.5 * MARGIN_M
    drive.tick()
    assert drive.state["safety"][0] == Safety.ENABLED
    drive.state["clearance"] = limit - 3.0 * MARGIN_M
    drive.tick()
    assert drive.safety == Safety.PAUSED


def test_away_from_everything_the_limit_counts_again(robot: InstrumentRobot) -> None:
    limit = robot.configuration.limits.clearance_mm * 1e-3
    drive = brought_near(robot, limit - MARGIN_M)
    drive.tick()
    drive.tick(Request.ENABLE)
    drive.state["clearance"] = limit + MARGIN_M
    drive.tick()
    drive.state["clearance"] = limit - 0.5 * MARGIN_M
    drive.tick()
    assert drive.safety == Safety.PAUSED


@pytest.mark.parametrize("distance", [0.009, np.nan])
def test_a_shaft_beside_the_trocar_is_a_fault(robot: InstrumentRobot, distance: float) -> None:
    drive = Drive(robot)
    drive.enable()
    drive.state["trocar_distance"] = distance
    drive.tick()
    assert (drive.safety, drive.state["reason"][0]) == (Safety.FAULT, Event.TROCAR_LEFT)


def test_an_arm_that_is_pushed_is_noticed(robot: InstrumentRobot) -> None:
    """What counts is where the arm was measured, not where it was sent."""
    drive = Drive(robot)
    drive.enable()
    drive.obedient = False
    drive.input["measured_q"][0, 0] += 0.06
    for _ in range(2 * EVERY_TICKS):
        drive.tick()
    assert (drive.safety, drive.state["reason"][0]) == (Safety.FAULT, Event.TROCAR_LEFT)
