"""NSPQP: null-space projection as one constrained quadratic program, eq. (7)."""

from __future__ import annotations

import numpy as np

from robot.concentric.methods.quadratic_program import EQUALITY, solve_program
from robot.concentric.methods.rate_problem import RateProblem, Solution

REGULARISATION = 1e-6
"""ζ, in SI units."""


class Nspqp:
    """min ½ q̇ᵀ(J_AᵀJ_A + ζI)q̇ − v_AᵀJ_A q̇  with  J_AB q̇ = v_AB  inside the box of eq. (7)."""

    name = "nspqp"
    corrects = False

    def __init__(self, tubes: int) -> None:
        unknowns = 4 * tubes
        self._sense = np.zeros(unknowns + 3, dtype=np.int32)
        self._sense[unknowns:] = EQUALITY
        self._upper, self._lower = np.zeros(unknowns + 3), np.zeros(unknowns + 3)
        self._hessian = np.zeros((unknowns, unknowns))
        self._linear = np.zeros(unknowns)
        self._regular = REGULARISATION * np.eye(unknowns)

    def solve(self, problem: RateProblem) -> Solution:
        """Fill the problem's rates; zero where the equality and the box exclude each other."""
        jacobian, count = problem.tracking_jacobian, len(problem.rates)
        np.matmul(jacobian.T, jacobian, out=self._hessian)
        self._hessian += self._regular
        np.matmul(jacobian.T, problem.tracking_velocity, out=self._linear)
        np.negative(self._linear, out=self._linear)
        self._lower[:count], self._upper[:count] = problem.box_lower, problem.box_upper
        self._lower[count:] = self._upper[count:] = problem.relative_velocity
        rates, solution = solve_program(
            self._hessian,
            self._linear,
            problem.relative_jacobian,
            self._upper,
            self._lower,
            self._sense,
        )
        problem.rates[:] = rates if solution == Solution.SOLVED else 0.0
        return solution
