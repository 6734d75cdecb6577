"""One quadratic program by daqp, cold, so that a replay is the same bit for bit."""

from __future__ import annotations

import daqp
import numpy as np

from robot.concentric.methods.rate_problem import Solution

EQUALITY = 5
"""Sense of a row whose bounds are one number."""
_TOLERANCES = (1e-9, 1e-8, 1e-7)
"""How far (m/s, rad/s) a row may be off; the next where the solver goes in circles."""
_INFEASIBLE = -1


def solve_program(
    hessian: np.ndarray,
    linear: np.ndarray,
    matrix: np.ndarray,
    upper: np.ndarray,
    lower: np.ndarray,
    sense: np.ndarray,
) -> tuple[np.ndarray, Solution]:
    """Minimise ½ xᵀ hessian x + linearᵀ x  with  lower <= [x; matrix x] <= upper.

    Args:
        hessian: (n, n) positive definite.
        linear: (n,).
        matrix: (m, n).
        upper: (n + m,).
        lower: (n + m,).
        sense: (n + m,) ``EQUALITY`` or 0.

    Returns:
        The solution (n,), of no use unless ``SOLVED``.
    """
    for tolerance in _TOLERANCES:
        found, _, flag, _ = daqp.solve(
            hessian, linear, matrix, upper, lower, sense, primal_tol=tolerance
        )
        if flag > 0:
            return found, Solution.SOLVED
        if flag == _INFEASIBLE:
            return found, Solution.INFEASIBLE
    return found, Solution.FAILED
