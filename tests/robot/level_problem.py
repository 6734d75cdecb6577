"""One problem of levels under limits, for the solver under test and for an independent one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear, nnls

from robot.arm import Arm
from robot.priority.levels import PRESETS, Plan, assemble, plan
from robot.priority.lexicographic import LexicographicProblem
from robot.priority.limits import rate_limits
from robot.priority.meet_all import meet_all
from robot.records import Case
from tests.robot.drive import DT
from tests.robot.task_rows import catalogue

LENGTH = 0.1
CASES = tuple(Case)
_PENALTY = 1e6


def _row_space(rows: np.ndarray) -> np.ndarray:
    """Orthonormal rows (r, n) that span the rows (m, n)."""
    _, values, right = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(right[values > 1e-9 * values[0]])


def plan_of(case: Case, levels: int | None = None) -> Plan:
    """The preset, or its first ``levels`` levels."""
    return plan(PRESETS[case][:levels], LENGTH)


@dataclass
class LevelProblem:
    """Wanted rates of ten task rows, and limits.

    Attributes:
        rows: (10, 10) catalogue.
        targets: (10,).
        preferred: (10,).
        lower: (10,) bounds of the rates.
        upper: (10,).
        bend_row: (10,) zero but for u and v.
        bend_bound: largest ``bend_row @ rates``.
    """

    rows: np.ndarray
    targets: np.ndarray
    preferred: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    bend_row: np.ndarray
    bend_bound: float

    def levels(self, of: Plan) -> list[tuple[np.ndarray, np.ndarray]]:
        """Weighted rows and targets, level by level."""
        found = []
        for span in of.spans():
            chosen = of.rows[span.start : span.stop]
            weights = of.weights[span.start : span.stop]
            found.append((weights[:, None] * self.rows[chosen], weights * self.targets[chosen]))
        return found

    def _memory(self, of: Plan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        matrix, upper, lower = np.zeros((11, 10)), np.zeros(21), np.full(21, -1e30)
        matrix[0], lower[:10] = self.bend_row, self.lower
        upper[:10], upper[10] = self.upper, self.bend_bound
        assemble(self.rows, self.targets, of.rows, of.weights, of.starts, matrix[1:], upper[11:])
        lower[11 : 11 + len(of.rows)] = upper[11 : 11 + len(of.rows)]
        return matrix, upper, lower

    def solve(self, of: Plan, damping: float = 0.0) -> np.ndarray:
        """Rates (10,) of the solver under test; fails if it does."""
        matrix, upper, lower = self._memory(of)
        rates, flag = LexicographicProblem(of, matrix, upper, lower).solve(self.preferred, damping)
        assert flag > 0
        return np.asarray(rates)

    def meet_all(self, of: Plan) -> np.ndarray | None:
        """Rates (10,) where the levels can be met together, or None."""
        matrix, upper, lower = self._memory(of)
        rates, count = np.empty(10), len(of.rows)
        met = meet_all(
            matrix[1 : 1 + count],
            upper[11 : 11 + count],
            self.preferred,
            lower,
            upper,
            matrix[0],
            rates,
        )
        return rates if met else None

    def oracle(self, of: Plan) -> np.ndarray:
        """Rates (10,) by bounded least squares, one level after the other.

        In coordinates in which the bend row is an axis, the limits are a box; that needs the box
        of u and v to be wide where the row is not an axis already.
        """
        turn = np.eye(10)
        n = self.bend_row[7:9]
        turn[7:9, 7:9] = [[n[0], -n[1]], [n[1], n[0]]]
        lower, upper = self.lower.copy(), self.upper.copy()
        if abs(n[1]) > 0.0:
            lower[7:9], upper[7:9] = -1e6, 1e6
        upper[7] = min(upper[7], self.bend_bound)
        kept, reached, rates = np.zeros((0, 10)), np.zeros(0), np.zeros(10)
        for matrix, target in [*self.levels(of), (np.eye(10), self.preferred)]:
            turned = matrix @ turn
            stacked = np.vstack([_PENALTY * kept, turned])
            right = np.concatenate([_PENALTY * reached, target])
            found = lsq_linear(
                stacked, right, (lower, upper), method="bvls", tol=1e-15, max_iter=1000
            )
            rates = np.asarray(found.x)
            kept = np.vstack([kept, turned])
            reached = np.concatenate([reached, turned @ rates])
        return np.asarray(turn @ rates)

    def optimality(self, of: Plan, rates: np.ndarray, touch: float = 1e-6) -> list[float]:
        """How far each level, and last the preference, is from the best it could have.

        Best (Karush, Kuhn, Tucker): the slope of a level's squared residual, outside the span of
        the rows above it, is balanced by limits that are touched, each pushing inward. What cannot
        be balanced is returned, as a rate.
        """
        limits = np.vstack([np.eye(10), -np.eye(10), self.bend_row])
        bounds = np.concatenate([self.upper, -self.lower, [self.bend_bound]])
        touched = limits[limits @ rates > bounds - touch]
        kept, unbalanced = np.zeros((0, 10)), []
        for matrix, target in [*self.levels(of), (np.eye(10), self.preferred)]:
            left = target - matrix @ rates
            free = np.eye(10) - kept.T @ kept
            slope = free @ (matrix.T @ left)
            missing = np.linalg.norm(slope)
            if len(touched) > 0:
                _, missing = nnls(free @ touched.T, slope, maxiter=1000)
            unbalanced.append(float(missing) / float(np.linalg.norm(matrix, 2)) ** 2)
            kept = _row_space(np.vstack([kept, matrix]))
        return unbalanced

    def residuals(self, of: Plan, rates: np.ndarray) -> list[float]:
        """Norm of what each level of the plan left over."""
        return [float(np.linalg.norm(b - a @ rates)) for a, b in self.levels(of)]

    def excess(self, rates: np.ndarray) -> float:
        """How far the rates leave the limits, at most 0 if they do not."""
        over = [rates - self.upper, self.lower - rates]
        return float(max(*over[0], *over[1], self.bend_row @ rates - self.bend_bound))


def random_problem(rng: np.random.Generator, tight: float) -> LevelProblem:
    """Random rows, limits of about ``tight`` around zero, the bend row along u or tilted."""
    rows = rng.normal(size=(10, 10)) * 10.0 ** rng.uniform(-0.5, 0.5, size=(10, 1))
    rows[9] = np.eye(10)[9]
    lower, upper = -rng.uniform(0.2, 1, 10) * tight, rng.uniform(0.2, 1, 10) * tight
    angle = 0.0 if rng.uniform() < 0.5 else rng.uniform(-math.pi, math.pi)
    bend_row = np.zeros(10)
    bend_row[7:9] = math.cos(angle), math.sin(angle)
    if angle != 0.0:
        lower[7:9], upper[7:9] = -1e3, 1e3
    return LevelProblem(
        rows,
        rng.normal(size=10),
        0.1 * rng.normal(size=10),
        lower,
        upper,
        bend_row,
        rng.uniform(0.1, 1) * tight,
    )


def limits_at(
    x: np.ndarray, parameters: np.ndarray, dt: float = DT
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Lower and upper bounds (10,) of the rates, bend row and its bound at ``x`` (10,)."""
    lower, upper, bend_row = np.empty(10), np.empty(10), np.empty(10)
    bound = rate_limits(x, dt, parameters, lower, upper, bend_row)
    return lower, upper, bend_row, bound


def robot_problem(
    arm: Arm, parameters: np.ndarray, x: np.ndarray, rng: np.random.Generator, speed: float = 1.0
) -> LevelProblem:
    """Real Jacobians and limits at ``x`` (10,); commands up to ``speed`` times 60 mm/s, 1 rad/s."""
    targets = np.zeros(10)
    targets[3:6] = 0.06 * speed * rng.uniform(-1, 1, 3)
    targets[6:9] = speed * rng.uniform(-1, 1, 3)
    targets[9] = rng.uniform(-0.3, 0.3)
    preferred = np.concatenate([0.05 * rng.normal(size=7), np.zeros(2), [targets[9]]])
    rows = catalogue(arm, parameters, x)
    return LevelProblem(rows, targets, preferred, *limits_at(x, parameters))
