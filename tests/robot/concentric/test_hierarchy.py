"""hqp: levels of bounded least squares under coupled limits."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from robot.concentric.methods.hqp import Hqp
from robot.concentric.methods.rate_problem import RateProblem, Solution
from robot.concentric.proximal import Proximal, braking_rate
from tests.robot.concentric.pair_problem import configurations, design, rate_problem

SPEEDS = (0.003, 0.01, 0.05)
"""Wanted tip speeds from what the tubes can do to far more, m/s."""


def limits(problem: RateProblem) -> tuple[np.ndarray, np.ndarray]:
    """All limits as rows (m, 4n) and bounds (m,), rates at most the bounds."""
    n, ends = problem.tubes, problem.proximal
    unit = np.eye(4 * n)
    rows, bounds = [], []
    for arm in range(2):
        for i in range(n):
            place = 2 * n * arm + i
            for sign, room in (
                (1.0, ends.upper[i] - problem.beta[arm, i]),
                (-1.0, problem.beta[arm, i] - ends.lower[i]),
            ):
                rows.append(sign * unit[place])
                bounds.append(braking_rate(room, problem.period, ends.speed, ends.acceleration))
                rows.append(sign * unit[place + n])
                bounds.append(problem.rotation_speed)
        for i in range(n - 1):
            row = np.zeros(4 * n)
            row[2 * n * arm + i], row[2 * n * arm + i + 1] = -1.0, 1.0
            rows += [row, -row]
            bounds += [
                problem.gap_upper[(n - 1) * arm + i],
                -problem.gap_lower[(n - 1) * arm + i],
            ]
    return np.array(rows), np.array(bounds)


def levels(problem: RateProblem) -> list[tuple[np.ndarray, np.ndarray]]:
    return [
        (problem.relative_jacobian, problem.relative_velocity),
        (problem.tracking_jacobian, problem.tracking_velocity),
    ]


def optimality(problem: RateProblem, unit: np.ndarray) -> tuple[list[float], int]:
    """How far each level is from the best it could have (KKT), and how many limits are touched.

    In the scaled unknowns; what cannot be balanced, as a share of what the level wants.
    """
    shares = problem.rates / unit
    rows, bounds = limits(problem)
    rows = rows * unit
    size = np.linalg.norm(rows, axis=1)
    rows, bounds = rows / size[:, None], bounds / size
    pushing = rows[rows @ shares > bounds - 1e-6]
    kept, missing = np.zeros((0, len(unit))), []
    for jacobian, wanted in levels(problem):
        matrix = jacobian * unit
        slope = matrix.T @ (wanted - matrix @ shares)
        free = np.eye(len(unit))
        if len(kept):
            _, values, right = np.linalg.svd(kept, full_matrices=False)
            span = right[values > 1e-9 * values[0]]
            free = free - span.T @ span
        slope = free @ slope
        norm = float(np.linalg.norm(slope))
        if len(pushing):
            _, norm = nnls(free @ pushing.T, slope, maxiter=2000)
        missing.append(float(norm / np.linalg.norm(matrix, 2) ** 2))
        kept = np.vstack([kept, matrix])
    return missing, len(pushing)


def unit_of(problem: RateProblem) -> np.ndarray:
    found = np.empty(len(problem.rates))
    found[problem.translations] = problem.proximal.speed
    found[problem.rotations] = problem.rotation_speed
    return found


def problems(rng: np.random.Generator) -> list[RateProblem]:
    found = []
    for speed in SPEEDS:
        for q in configurations():
            pressed = q.copy()
            if rng.uniform() < 0.5:  # neighbours at their closest
                pressed[1] = pressed[0] + 0.001 + rng.uniform(0.0, 3e-4)
            if 1e3 * Proximal(design()).excess(pressed[:3]) < 1e-6:
                found.append(rate_problem(pressed, rng, speed))
    return found


def test_each_level_is_the_best_that_limits_and_the_level_above_leave(
    rng: np.random.Generator,
) -> None:
    active = 0
    for problem in problems(rng):
        assert Hqp(problem).solve(problem) == Solution.SOLVED
        missing, touched = optimality(problem, unit_of(problem))
        assert max(missing) < 1e-5
        active += touched > 2
    assert active > 12


def test_no_limit_is_left(rng: np.random.Generator) -> None:
    for problem in problems(rng):
        assert Hqp(problem).solve(problem) == Solution.SOLVED
        rows, bounds = limits(problem)
        assert (rows @ problem.rates - bounds).max() < 1e-10


def test_what_can_be_done_is_done(rng: np.random.Generator) -> None:
    met = 0
    for q in configurations()[3:]:
        problem = rate_problem(q, rng, 0.001)
        assert Hqp(problem).solve(problem) == Solution.SOLVED
        for jacobian, wanted in levels(problem):
            met += bool(np.linalg.norm(wanted - jacobian @ problem.rates) < 1e-8)
    assert met > 20


def test_tracking_never_costs_the_relative_position(rng: np.random.Generator) -> None:
    for q in configurations():
        problem = rate_problem(q, rng, 0.05)
        left = []
        for factor in (0.0, 1.0, 20.0):
            wanted = factor * problem.tracking_velocity
            problem.tracking_velocity[:], kept = wanted, problem.tracking_velocity.copy()
            assert Hqp(problem).solve(problem) == Solution.SOLVED
            problem.tracking_velocity[:] = kept
            jacobian, asked = levels(problem)[0]
            left.append(np.linalg.norm(asked - jacobian @ problem.rates))
        np.testing.assert_allclose(left, left[0], rtol=0, atol=2e-8)


def test_standing_still_is_a_solution_where_nothing_is_wanted(rng: np.random.Generator) -> None:
    for q in configurations():
        problem = rate_problem(q, rng, 0.0)
        assert Hqp(problem).solve(problem) == Solution.SOLVED
        np.testing.assert_allclose(problem.rates, 0.0, atol=1e-12)


def test_solving_twice_gives_the_same_bits(rng: np.random.Generator) -> None:
    for problem in problems(rng)[::5]:
        hqp = Hqp(problem)
        hqp.solve(problem)
        first = problem.rates.tobytes()
        hqp.solve(problem)
        assert problem.rates.tobytes() == first
