"""The paper's methods: what their inverses and programs are, against the definitions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear, nnls

from robot.concentric.design import METHODS
from robot.concentric.methods.choice import method_named
from robot.concentric.methods.nspqp import REGULARISATION as NSPQP_REGULARISATION
from robot.concentric.methods.nspwln import (
    TRACKING_WEIGHT,
    limit_slope,
    printed_inverse,
    weighted_inverse,
    weights,
)
from robot.concentric.methods.rate_problem import RateProblem, Solution
from robot.concentric.methods.snsqp import REGULARISATION as SNSQP_REGULARISATION
from robot.errors import UnknownName
from tests.robot.concentric.pair_problem import configurations, rate_problem

RANDOM = slice(3, None)
"""Configurations in which nothing is planar."""


def solve(name: str, problem: RateProblem) -> Solution:
    return method_named(name, problem).solve(problem)


def unbalanced(slope: np.ndarray, kept: np.ndarray, pushing: np.ndarray) -> float:
    """What of a cost's descent neither kept rows nor touched bounds balance (KKT), as a share."""
    _, values, right = np.linalg.svd(kept, full_matrices=False)
    rows = right[values > 1e-10 * values[0]]
    free = np.eye(kept.shape[1]) - rows.T @ rows
    if len(pushing) == 0:
        return float(np.linalg.norm(free @ slope) / np.linalg.norm(slope))
    _, missing = nnls(free @ pushing.T, free @ slope, maxiter=1000)
    return float(missing / np.linalg.norm(slope))


def touched(rates: np.ndarray, problem: RateProblem) -> np.ndarray:
    """Outward normals (m, 4n) of the bounds of eq. (7) that the rates touch."""
    unit = np.eye(len(rates))
    up = unit[rates >= problem.box_upper - 1e-8]
    return np.vstack([up, -unit[rates <= problem.box_lower + 1e-8]])


def test_every_method_has_its_name() -> None:
    problem = rate_problem(configurations()[0], np.random.default_rng(0))
    for name in METHODS:
        assert method_named(name, problem).name == name
    with pytest.raises(UnknownName, match="nspqp, snsqp, hqp"):
        method_named("dls", problem)


def test_the_repaired_inverse_is_one_and_its_projector_projects(rng: np.random.Generator) -> None:
    for q in configurations()[RANDOM]:
        problem = rate_problem(q, rng)
        jacobian = problem.relative_jacobian
        inverse = weighted_inverse(jacobian, weights(problem))
        np.testing.assert_allclose(jacobian @ inverse, np.eye(3), rtol=0, atol=2e-5)
        projector = np.eye(12) - inverse @ jacobian
        np.testing.assert_allclose(projector @ projector, projector, rtol=0, atol=1e-4)
        np.testing.assert_allclose(jacobian @ projector, 0.0, rtol=0, atol=2e-5)


def test_the_printed_inverse_is_twice_one_and_no_projector(rng: np.random.Generator) -> None:
    for q in configurations()[RANDOM]:
        problem = rate_problem(q, rng)
        jacobian = problem.relative_jacobian
        inverse = printed_inverse(jacobian, weights(problem))
        np.testing.assert_allclose(jacobian @ inverse, 2.0 * np.eye(3), rtol=0, atol=5e-5)
        printed = np.eye(12) - inverse @ jacobian
        np.testing.assert_allclose(jacobian @ printed, -jacobian, rtol=0, atol=5e-5)
        assert np.abs(printed @ printed - printed).max() > 0.1


def test_both_forms_of_the_weighted_inverse_agree(rng: np.random.Generator) -> None:
    for q in configurations()[RANDOM]:
        problem = rate_problem(q, rng)
        jacobian, weight = problem.relative_jacobian, weights(problem)
        primal = jacobian.T @ jacobian * TRACKING_WEIGHT + np.diag(weight)
        expected = np.linalg.solve(primal, jacobian.T * TRACKING_WEIGHT)
        np.testing.assert_allclose(
            weighted_inverse(jacobian, weight), expected, rtol=2e-3, atol=1e-5
        )


def test_weights_grow_toward_the_bounds_and_are_one_midway() -> None:
    least, largest = np.array([-0.1]), np.array([0.0])
    slopes = [
        limit_slope(np.array([beta]), least, largest)[0]
        for beta in (-0.05, -0.03, -0.01, -0.001, 0.0, 0.01)
    ]
    assert slopes[0] == pytest.approx(0.0, abs=1e-12)
    assert np.all(np.diff(slopes[:5]) > 0.0)
    assert np.all(np.isfinite(slopes))
    # 100 mm of room, 1 mm from its end: 100² · 98 / (4 · 1² · 99²)
    assert slopes[3] == pytest.approx(100.0**2 * 98.0 / (4.0 * 99.0**2))


def test_nspwln_follows_eq_6(rng: np.random.Generator) -> None:
    for q in configurations()[RANDOM]:
        problem = rate_problem(q, rng)
        v, va = problem.relative_velocity, problem.tracking_velocity
        weight = weights(problem)
        inverse = printed_inverse(problem.relative_jacobian, weight)
        gradient = weighted_inverse(problem.tracking_jacobian, weight) @ va
        expected = inverse @ v + (np.eye(12) - inverse @ problem.relative_jacobian) @ gradient
        assert solve("nspwln", problem) == Solution.SOLVED
        np.testing.assert_allclose(problem.rates, expected, rtol=1e-6, atol=1e-9)
        assert solve("nspwln-repaired", problem) == Solution.SOLVED
        np.testing.assert_allclose(problem.relative_jacobian @ problem.rates, v, atol=1e-6)
        np.testing.assert_allclose(problem.tracking_jacobian @ problem.rates, va, atol=1e-6)


def test_nspqp_keeps_its_constraints_and_is_optimal(rng: np.random.Generator) -> None:
    bound = 0
    for q in configurations()[RANDOM] * 3:
        problem = rate_problem(q, rng)
        assert solve("nspqp", problem) == Solution.SOLVED
        rates, jacobian = problem.rates, problem.tracking_jacobian
        left = problem.relative_velocity - problem.relative_jacobian @ rates
        np.testing.assert_allclose(left, 0.0, atol=2e-9)
        assert np.all(rates <= problem.box_upper + 1e-8)
        assert np.all(rates >= problem.box_lower - 1e-8)
        slope = jacobian.T @ (problem.tracking_velocity - jacobian @ rates)
        slope -= NSPQP_REGULARISATION * rates
        pushing = touched(rates, problem)
        bound += len(pushing) > 0
        assert np.linalg.norm(slope) * unbalanced(slope, problem.relative_jacobian, pushing) < 1e-8
    assert bound > 8


def test_nspqp_says_when_the_tubes_cannot_be_that_fast(rng: np.random.Generator) -> None:
    """Configuration 3 is planar: in its plane the tips move by translations only."""
    problem = rate_problem(configurations()[2], rng)
    problem.relative_velocity[:] = 0.0, 0.0, 0.05
    assert solve("nspqp", problem) == Solution.INFEASIBLE
    assert not problem.rates.any()


def test_snsqp_scales_what_nspqp_cannot_do(rng: np.random.Generator) -> None:
    problem = rate_problem(configurations()[2], rng)
    problem.relative_velocity[:] = 0.0, 0.0, 0.05
    assert solve("snsqp", problem) == Solution.SOLVED
    scale = problem.scales[0]
    assert 0.1 < scale < 0.9
    np.testing.assert_allclose(
        problem.relative_jacobian @ problem.rates, scale * problem.relative_velocity, atol=1e-7
    )
    assert np.abs(problem.rates[problem.translations]).max() <= 0.005 + 1e-8


def test_snsqp_is_bounded_least_squares_in_rates_and_scale(rng: np.random.Generator) -> None:
    """Eq. (8) for the last task, with its equalities as rows of a large weight."""
    compared = 0
    for q in configurations()[RANDOM]:
        problem = rate_problem(q, rng)
        assert solve("snsqp", problem) == Solution.SOLVED
        zeta, rates, scale = SNSQP_REGULARISATION, problem.rates, problem.scales[1]
        kept = problem.relative_jacobian @ rates
        np.testing.assert_allclose(kept, problem.scales[0] * problem.relative_velocity, atol=1e-7)
        rows = np.zeros((6 + 13, 13))
        rows[:3, :12], rows[3:6, :12] = problem.relative_jacobian, problem.tracking_jacobian
        rows[3:6, 12] = -problem.tracking_velocity
        rows[:6] *= 1e5
        rows[6:18, :12], rows[18, 12] = np.sqrt(0.5 * zeta) * np.eye(12), np.sqrt(1.0 / zeta)
        right = np.concatenate([1e5 * kept, np.zeros(15), [np.sqrt(1.0 / zeta)]])
        box = np.append(problem.box_lower, 0.0), np.append(problem.box_upper, 1.0 + 1e-12)
        found = lsq_linear(rows, right, box, method="bvls", tol=1e-14, max_iter=2000)
        if np.abs(rows[:6] @ found.x - right[:6]).max() < 1e-3:
            compared += 1
            np.testing.assert_allclose(scale, found.x[12], atol=2e-4)
            np.testing.assert_allclose(rates, found.x[:12], rtol=0, atol=1e-4)
    assert compared > 6
