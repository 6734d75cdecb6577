"""Arm and instrument together: where tip and shaft are, and how they move with x."""

from __future__ import annotations

import numpy as np
import pytest

from robot.arm import Arm
from robot.configuration import Configuration
from robot.forward import ForwardKinematics, measure_errors
from robot.instrument import project_on_shaft
from robot.instrument_robot import InstrumentRobot
from robot.records import TRUTH
from robot.urdf import urdf_text
from tests import own_kinematics
from tests.robot.differences import twist_columns
from tests.robot.drive import random_rotation, random_x, wxyz
from tests.robot.task_rows import jacobians

BENDS = (0.0, 1e-5, 0.02, 1.0)
"""Shares of the bend limit: straight, nearly straight, in between, anywhere."""


@pytest.mark.parametrize("bend", BENDS)
def test_tip_jacobian_is_the_derivative(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, bend: float
) -> None:
    def pose(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        where = own_kinematics.pose_at(robot.configuration, x)
        return where.tip, where.rotation

    for _ in range(15):
        x = random_x(robot, rng, bend)
        of_tip, _, _ = jacobians(arm, robot.parameters, x)
        np.testing.assert_allclose(of_tip, twist_columns(pose, x), rtol=0, atol=1e-7)
        assert not of_tip[:, 9].any()


def test_rcm_jacobian_is_the_derivative(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    def pose(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        where = own_kinematics.pose_at(robot.configuration, x)
        return where.shaft_base + x[9] * (where.shaft_end - where.shaft_base), np.eye(3)

    for _ in range(40):
        x = random_x(robot, rng)
        _, of_rcm, _ = jacobians(arm, robot.parameters, x)
        np.testing.assert_allclose(of_rcm, twist_columns(pose, x)[:3], rtol=0, atol=1e-7)
        where = own_kinematics.pose_at(robot.configuration, x)
        shaft = where.shaft_end - where.shaft_base
        np.testing.assert_allclose(of_rcm[:, 9], shaft, rtol=0, atol=1e-12)
        assert not of_rcm[:, 7:9].any()


def test_forward_kinematics_are_the_independent_ones(
    configuration: Configuration, robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    forward = ForwardKinematics(urdf_text(configuration), robot.parameters)
    truth = np.zeros(1, TRUTH)
    for _ in range(50):
        x = random_x(robot, rng)
        forward.fill(truth, np.ascontiguousarray(x[:7]), x[7], x[8])
        expected = own_kinematics.pose_at(configuration, x)
        found = truth[0]
        np.testing.assert_allclose(found["position"], expected.tip, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found["shaft_base"], expected.shaft_base, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found["shaft_end"], expected.shaft_end, rtol=0, atol=1e-12)
        np.testing.assert_array_equal([*found["q"], *found["uv"]], x[:9])
        state = robot.initial_state(x)[0]
        np.testing.assert_allclose(state["tip_position"], expected.tip, rtol=0, atol=1e-12)
        np.testing.assert_allclose(state["tip_rotation"], expected.rotation, rtol=0, atol=1e-12)


def test_errors_are_distance_angle_and_distance_from_the_shaft(rng: np.random.Generator) -> None:
    truth = np.zeros(1, TRUTH)
    for _ in range(50):
        base, end, tip, trocar, desired = rng.uniform(-1, 1, (5, 3))
        own, wanted = random_rotation(rng), random_rotation(rng)
        truth["shaft_base"], truth["shaft_end"], truth["position"] = base, end, tip
        truth["wxyz"] = wxyz(own)
        truth["trocar_position"] = trocar
        measure_errors(truth, desired, wxyz(wanted))
        found = truth[0]
        assert found["position_error"] == pytest.approx(np.linalg.norm(desired - tip), abs=1e-14)
        assert found["orientation_error"] == pytest.approx(
            (wanted * own.inv()).magnitude(), abs=1e-12
        )
        expected = own_kinematics.distance_from_axis(trocar, base, end)
        assert found["rcm_error"] == pytest.approx(expected, abs=1e-13)


def test_projection_on_the_shaft_finds_place_and_distance(rng: np.random.Generator) -> None:
    for _ in range(100):
        base, end = rng.uniform(-1, 1, (2, 3))
        shaft = end - base
        aside = np.cross(shaft, rng.normal(size=3))
        distance, fraction = rng.uniform(0, 0.1), rng.uniform(-0.5, 1.5)
        point = base + fraction * shaft + distance * aside / np.linalg.norm(aside)
        found, away = project_on_shaft(point, base, end)
        assert found == pytest.approx(fraction, abs=1e-12)
        assert away == pytest.approx(distance, abs=1e-12)
