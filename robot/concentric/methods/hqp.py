"""hqp: a hierarchy of least-squares levels under all limits, by the first robot's solver.

Limits stand above every level: speeds, (1) as rows that couple neighbouring tubes, all with
braking, so that standing still is always allowed, and near snapping how fast the stability
determinants may fall. Then, level by level: the relative position, the
tracking of A, and the least motion.
"""

from __future__ import annotations

import numpy as np

from robot.compiled import compiled
from robot.concentric.methods.rate_problem import UNBOUNDED, RateProblem, Solution
from robot.concentric.proximal import braking_rate
from robot.priority.levels import Plan, equalize
from robot.priority.lexicographic import LexicographicProblem

_LEVELS = Plan(np.arange(6), np.ones(6), np.array([0, 3, 6]))


@compiled
def _box(
    beta: np.ndarray,
    least: np.ndarray,
    largest: np.ndarray,
    period: float,
    speed: float,
    acceleration: float,
    lower: np.ndarray,
    upper: np.ndarray,
) -> None:
    """Bounds of the translations' rates, as shares of the speed, from each tube's own ends."""
    arms, tubes = beta.shape
    for arm in range(arms):
        for n in range(tubes):
            place = 2 * tubes * arm + n
            below, above = beta[arm, n] - least[n], largest[n] - beta[arm, n]
            lower[place] = -braking_rate(below, period, speed, acceleration) / speed
            upper[place] = braking_rate(above, period, speed, acceleration) / speed


class Hqp:
    """Levels: relative position, tracking of A; then the motion nearest to the preferred rates.

    The unknowns are rates as shares of their caps: 5 mm/s of translation cost as much as 0.5 rad/s
    of rotation.
    """

    name = "hqp"
    corrects = True

    def __init__(self, problem: RateProblem) -> None:
        n = problem.tubes
        unknowns, self._gaps = 4 * n, 2 * (n - 1)
        self._limits = self._gaps + 2
        self._unit = np.zeros(unknowns)
        self._unit[problem.translations] = problem.proximal.speed
        self._unit[problem.rotations] = problem.rotation_speed
        size = unknowns + self._limits + 6
        self._matrix = np.zeros((self._limits + 6, unknowns))
        self._lower, self._upper = np.full(size, -1.0), np.full(size, 1.0)
        for arm in range(2):
            gaps = slice((n - 1) * arm, (n - 1) * (arm + 1))
            self._matrix[gaps, 2 * n * arm : 2 * n * (arm + 1)] = problem.proximal.rows()
        self._preferred = np.zeros(unknowns)
        self._solver = LexicographicProblem(
            _LEVELS, self._matrix, self._upper, self._lower, self._limits
        )

    def solve(self, problem: RateProblem) -> Solution:
        """Fill the problem's rates; zero where the solver fails, which it must not."""
        count, speed = len(problem.rates), problem.proximal.speed
        lower, upper, levels = self._lower, self._upper, self._matrix[self._limits :]
        _box(
            problem.beta,
            problem.proximal.lower,
            problem.proximal.upper,
            problem.period,
            speed,
            problem.proximal.acceleration,
            lower,
            upper,
        )
        lower[count : count + self._gaps] = problem.gap_lower / speed
        upper[count : count + self._gaps] = problem.gap_upper / speed
        self._keep_stable(problem)
        np.multiply(problem.relative_jacobian, self._unit, out=levels[:3])
        np.multiply(problem.tracking_jacobian, self._unit, out=levels[3:])
        wanted = upper[count + self._limits :]
        wanted[:3], wanted[3:] = problem.relative_velocity, problem.tracking_velocity
        equalize(levels[:3], wanted[:3])
        equalize(levels[3:], wanted[3:])
        lower[count + self._limits :] = wanted
        np.divide(problem.preferred, self._unit, out=self._preferred)
        shares, flag = self._solver.solve(self._preferred, problem.damping)
        if flag <= 0:
            problem.rates[:] = 0.0
            return Solution.FAILED
        np.clip(shares, lower[:count], upper[:count], out=problem.rates)  # the tolerance
        problem.rates *= self._unit
        return Solution.SOLVED

    def _keep_stable(self, problem: RateProblem) -> None:
        """The rows of the stability determinants; unbounded where an arm is far from snapping."""
        half = len(problem.rates) // 2
        for arm in range(2):
            row, place = self._matrix[self._gaps + arm], len(problem.rates) + self._gaps + arm
            row[:] = 0.0
            row[half * arm] = 1.0
            self._lower[place], self._upper[place] = -UNBOUNDED, UNBOUNDED
            fall = problem.stability_fall[arm]
            if np.isfinite(fall):
                own = slice(half * arm, half * (arm + 1))
                np.multiply(problem.stability_slope[arm], self._unit[own], out=row[own])
                self._lower[place] = -fall
