"""SNSQP: saturation in the null space as one quadratic program for each task, eq. (8).

With 0 ≤ s_k ≤ 1, which the print leaves out: without it a task may run backward or too fast. And
where the second program has no solution, because the first task at its fastest drags A aside, the
first one's rates stand (s_2 = 0), as in the algorithm that (8) comes from (the paper's reference
12).
"""

from __future__ import annotations

import numpy as np

from robot.concentric.methods.quadratic_program import EQUALITY, solve_program
from robot.concentric.methods.rate_problem import RateProblem, Solution

REGULARISATION = 0.1
"""ζ, in SI units. Far below, the task is met at any speed that rotations can give."""


class Snsqp:
    """For task k: min ½ζ‖q̇‖² + (1 − s_k)²/ζ  with  J_k q̇ = s_k v_k, the tasks above kept, the box.

    The unknowns are [q̇, s_k].
    """

    name = "snsqp"
    corrects = False

    def __init__(self, tubes: int) -> None:
        count = 4 * tubes + 1
        self._hessian = REGULARISATION * np.eye(count)
        self._hessian[-1, -1] = 2.0 / REGULARISATION
        self._linear = np.zeros(count)
        self._linear[-1] = -2.0 / REGULARISATION
        self._matrix = np.zeros((6, count))
        self._upper, self._lower = np.zeros(count + 6), np.zeros(count + 6)
        self._upper[count - 1] = 1.0
        self._sense = np.zeros(count + 6, dtype=np.int32)
        self._sense[count:] = EQUALITY

    def solve(self, problem: RateProblem) -> Solution:
        """Fill the problem's rates and scales; zero where a program has no solution."""
        count = len(problem.rates)
        matrix, bounds = self._matrix, (self._lower, self._upper)
        self._lower[:count], self._upper[:count] = problem.box_lower, problem.box_upper
        matrix[:3, :count] = problem.relative_jacobian
        matrix[3:, :count] = problem.tracking_jacobian
        matrix[:3, count] = -problem.relative_velocity
        for bound in bounds:
            bound[count + 1 :] = 0.0
        first, solution = self._solve(3)
        if solution != Solution.SOLVED:
            return self._give_up(problem, solution)
        matrix[:3, count] = 0.0
        matrix[3:, count] = -problem.tracking_velocity
        for bound in bounds:
            bound[count + 1 : count + 4] = problem.relative_jacobian @ first[:count]
        second, solution = self._solve(6)
        if solution == Solution.INFEASIBLE:
            problem.rates[:] = first[:count]
            problem.scales[:] = first[count], 0.0
            return Solution.SOLVED
        if solution != Solution.SOLVED:
            return self._give_up(problem, solution)
        problem.rates[:] = second[:count]
        problem.scales[:] = first[count], second[count]
        np.clip(problem.scales, 0.0, 1.0, out=problem.scales)  # the tolerance
        return Solution.SOLVED

    def _solve(self, rows: int) -> tuple[np.ndarray, Solution]:
        size = len(self._linear) + rows
        return solve_program(
            self._hessian,
            self._linear,
            self._matrix[:rows],
            self._upper[:size],
            self._lower[:size],
            self._sense[:size],
        )

    @staticmethod
    def _give_up(problem: RateProblem, solution: Solution) -> Solution:
        problem.rates[:] = 0.0
        problem.scales[:] = 0.0
        return solution
