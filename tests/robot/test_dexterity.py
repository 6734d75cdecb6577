"""Dexterity measures: eqs. (111)-(113), raw and projected."""

from __future__ import annotations

import numpy as np
import pytest

from robot.configuration import Configuration
from robot.dexterity import Dexterity, measure
from robot.instrument_robot import InstrumentRobot
from robot.records import Case
from tests import own_kinematics
from tests.robot.differences import twist_columns
from tests.robot.drive import random_x


@pytest.fixture(scope="module")
def dexterity(configuration: Configuration) -> Dexterity:
    return Dexterity(configuration)


def test_measures_are_of_the_ellipsoid(rng: np.random.Generator) -> None:
    """Manipulability is the root of det(J J^T), the inverse condition the ellipsoid's shape."""
    for _ in range(50):
        jacobian = rng.normal(size=(3, 9))
        found = measure(jacobian)
        gram = jacobian @ jacobian.T
        axes = np.sqrt(np.linalg.eigvalsh(gram))
        assert found.manipulability == pytest.approx(np.sqrt(np.linalg.det(gram)), rel=1e-9)
        assert found.inverse_condition == pytest.approx(axes[0] / axes[-1], rel=1e-9)
        assert measure(7.0 * jacobian).inverse_condition == pytest.approx(
            found.inverse_condition, rel=1e-9
        )


def test_a_jacobian_without_a_direction_has_no_dexterity(rng: np.random.Generator) -> None:
    assert measure(np.zeros((3, 9))) == (0.0, 0.0)
    jacobian = rng.normal(size=(3, 9))
    jacobian[2] = jacobian[0] - jacobian[1]
    assert max(measure(jacobian)) < 1e-14


def test_its_jacobians_are_derivatives(
    robot: InstrumentRobot, dexterity: Dexterity, rng: np.random.Generator
) -> None:
    def pose(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        where = own_kinematics.pose_at(robot.configuration, x)
        return where.tip, where.rotation

    def at_trocar(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        where = own_kinematics.pose_at(robot.configuration, x)
        return where.shaft_base + x[9] * (where.shaft_end - where.shaft_base), np.eye(3)

    for _ in range(10):
        x = random_x(robot, rng)
        rcm, linear, angular = dexterity.jacobians(x)
        expected = twist_columns(pose, x)
        np.testing.assert_allclose(linear, expected[:3, :9], rtol=0, atol=1e-7)
        np.testing.assert_allclose(angular, expected[3:, :9], rtol=0, atol=1e-7)
        # Two rows, perpendicular to the shaft: what is left of the velocity's size there.
        where = own_kinematics.pose_at(robot.configuration, x)
        along = (where.shaft_end - where.shaft_base) / 0.230
        rows = twist_columns(at_trocar, x)[:3, :9]
        across = rows - np.outer(along, along @ rows)
        np.testing.assert_allclose(rcm.T @ rcm, across.T @ across, rtol=0, atol=1e-6)


def test_the_printed_measures_do_not_depend_on_the_case(
    robot: InstrumentRobot, dexterity: Dexterity, rng: np.random.Generator
) -> None:
    x = random_x(robot, rng)
    raw = [dexterity.at(x, case)["raw"] for case in Case]
    assert all(one == raw[0] for one in raw)


def test_angular_manipulability_cannot_be_what_table_5_prints(
    robot: InstrumentRobot, dexterity: Dexterity, rng: np.random.Generator
) -> None:
    """Seven unit columns: at a condition of 0.58 the product of the axes is 2.9 at the least."""
    for _ in range(50):
        _, _, angular = dexterity.jacobians(random_x(robot, rng))
        np.testing.assert_allclose(np.linalg.norm(angular[:, :7], axis=0), 1.0, atol=1e-9)
        found = measure(angular)
        axes = np.linalg.svd(angular, compute_uv=False)
        # Given their sum of squares (7 at least) and ratio, the product is least like this.
        least = (7.0 / (2.0 + found.inverse_condition**2)) ** 1.5 * found.inverse_condition
        assert np.sum(axes**2) >= 7.0
        assert found.manipulability >= least * (1.0 - 1e-9) or axes[1] < axes[0] * 0.999


@pytest.mark.parametrize(
    ("case", "projected_below"),
    [
        (Case.BALANCED, {"linear": (), "angular": ()}),
        (Case.LINEAR_FIRST, {"linear": (), "angular": ("linear",)}),
        (Case.ANGULAR_FIRST, {"linear": ("angular",), "angular": ()}),
        (Case.POINTING, {"linear": (), "angular": ("linear",)}),
    ],
)
def test_projected_measures_are_of_the_motions_that_higher_levels_leave(
    robot: InstrumentRobot,
    dexterity: Dexterity,
    rng: np.random.Generator,
    case: Case,
    projected_below: dict[str, tuple[str, ...]],
) -> None:
    for _ in range(10):
        x = random_x(robot, rng)
        rcm, linear, angular = dexterity.jacobians(x)
        rows = {"linear": linear, "angular": angular}
        found = dexterity.at(x, case)["projected"]
        for name, above in projected_below.items():
            higher = np.vstack([rcm, *(rows[one] for one in above)])
            motions = np.linalg.svd(higher)[2][len(higher) :]
            axes = np.linalg.svd(rows[name] @ motions.T, compute_uv=False)
            assert found[name]["manipulability"] == pytest.approx(
                float(np.prod(axes)), rel=1e-6, abs=1e-9
            )
            assert found[name]["manipulability"] <= measure(rows[name]).manipulability + 1e-12
