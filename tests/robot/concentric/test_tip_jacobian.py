"""The Jacobian of the tip, and that of the torsion, against differences."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tests.robot.concentric.arm_solution import (
    FOUR_TUBES,
    ArmSolution,
    configuration,
    overlapping_configuration,
    pose_near,
    random_configuration,
    solve,
    solve_stable,
)
from tests.robot.differences import twist_columns

THREE = FOUR_TUBES[:3]


def differences(solution: ArmSolution, q: np.ndarray, tubes: np.ndarray) -> np.ndarray:
    """Central differences, extrapolated once."""
    pose = pose_near(solution, tubes)
    fine, coarse = twist_columns(pose, q, 1e-5), twist_columns(pose, q, 2e-5)
    return np.asarray((4.0 * fine - coarse) / 3.0)


def assert_is_derivative(q: np.ndarray, tubes: np.ndarray) -> None:
    solution = solve_stable(q, tubes)
    expected = differences(solution, q, tubes)
    for rows in (slice(0, 3), slice(3, 6)):
        scale = max(1.0, float(np.max(np.abs(expected[rows]))))
        np.testing.assert_allclose(
            solution.jacobian[rows], expected[rows], rtol=0, atol=1e-7 * scale
        )


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_jacobian_is_the_derivative(count: int, rng: np.random.Generator) -> None:
    tubes = FOUR_TUBES[:count]
    for _ in range(30):
        assert_is_derivative(random_configuration(tubes, rng), tubes)
    for _ in range(30 if count > 1 else 0):
        assert_is_derivative(overlapping_configuration(tubes, rng, 0.02), tubes)


@pytest.mark.parametrize(
    ("translations", "rotations"),
    [
        ([-100, -80, -50], [45, 45, 45]),
        ([-150, -100, -50], [180, 90, 45]),
        ([-130, -120, -100], [90, -60, -270]),
        ([-250, -200, -120], [0, 0, 0]),
    ],
)
def test_jacobian_at_the_starts(translations: list[float], rotations: list[float]) -> None:
    assert_is_derivative(configuration(translations, rotations), THREE)


def test_planar_starts_have_rotation_columns_of_rank_one() -> None:
    for translations, rotations in (([-100, -80, -50], [45] * 3), ([-250, -200, -120], [0] * 3)):
        jacobian = solve_stable(configuration(translations, rotations), THREE).jacobian
        singular = np.linalg.svd(jacobian[:3, 3:], compute_uv=False)
        assert singular[0] > 0.01
        assert singular[1] < 1e-12


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_turning_all_tubes_turns_about_the_channel(count: int, rng: np.random.Generator) -> None:
    tubes = FOUR_TUBES[:count]
    for _ in range(20):
        solution = solve_stable(random_configuration(tubes, rng), tubes)
        together = solution.jacobian[:, count:].sum(axis=1)
        expected = np.append(np.cross([0.0, 0.0, 1.0], solution.position), [0.0, 0.0, 1.0])
        np.testing.assert_allclose(together, expected, rtol=0, atol=1e-11)


def test_torsion_change_is_the_derivative_of_the_torsion(rng: np.random.Generator) -> None:
    for _ in range(10):
        q = overlapping_configuration(THREE, rng)
        solution = solve_stable(q, THREE)
        for index in range(6):
            change = np.zeros(6)
            change[index] = 1e-5
            after = solve(q + change, THREE, solution.torsion).torsion
            before = solve(q - change, THREE, solution.torsion).torsion
            scale = max(1.0, float(np.max(np.abs(solution.torsion_change))))
            np.testing.assert_allclose(
                solution.torsion_change[:, index],
                (after - before) / 2e-5,
                rtol=0,
                atol=1e-6 * scale,
            )


def test_where_ends_coincide_it_is_the_derivative_of_one_side() -> None:
    """Tube 1 begins to curve just where tube 2 ends: moving either is a kink.

    On one side there is a stretch in which both are curved, on the other one in which none is.
    """
    q = configuration([-270, -200, -100], [40, -30, 120])
    assert q[0] + 0.387 == pytest.approx(q[1] + 0.317)
    here = solve_stable(q, THREE)
    pose = pose_near(here, THREE)
    for index, step in itertools.product((0, 1), (1e-6, -1e-6)):
        change = np.zeros(6)
        change[index] = step
        slope = (pose(q + change)[0] - here.position) / step
        beside = solve_stable(q + 0.01 * change, THREE).jacobian[:3, index]
        np.testing.assert_allclose(slope, beside, rtol=0, atol=1e-5)
        other = solve_stable(q - 0.01 * change, THREE).jacobian[:3, index]
        distance = min(
            float(np.max(np.abs(here.jacobian[:3, index] - side))) for side in (beside, other)
        )
        assert distance < 1e-6
    # Moved together, the two places stay together, and there is no kink.
    together = np.array([1e-5, 1e-5, 0.0, 0.0, 0.0, 0.0])
    slope = (pose(q + together)[0] - pose(q - together)[0]) / 2e-5
    np.testing.assert_allclose(here.jacobian[:3, :2].sum(axis=1), slope, rtol=0, atol=1e-7)


def test_a_section_of_no_length(rng: np.random.Generator) -> None:
    """Tubes 1 and 2 end together: nothing of tube 1 is left alone."""
    for _ in range(5):
        q = configuration([-220, -100, -50], np.degrees(rng.uniform(-1.0, 1.0, 3)).tolist())
        solution = solve_stable(q, THREE)
        inward = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]) * 1e-6
        longer = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]) * 1e-6
        assert solve(q + inward, THREE, solution.torsion).status != 0
        outward = solve(q + longer, THREE, solution.torsion)
        slope = (outward.position - solution.position) / 1e-6
        np.testing.assert_allclose(solution.jacobian[:3, 0], slope, rtol=0, atol=1e-4)
        np.testing.assert_allclose(
            solution.jacobian[:, 3:], differences_by_rotation(solution, q), rtol=0, atol=1e-7
        )


def differences_by_rotation(solution: ArmSolution, q: np.ndarray) -> np.ndarray:
    pose = pose_near(solution, THREE)
    return twist_columns(lambda turned: pose(np.append(q[:3], turned)), q[3:], 1e-5)
