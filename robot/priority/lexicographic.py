"""The levels as one lexicographic QP with all limits on top, solved by daqp.

Each level minimises its residual among the rates that keep the limits and do not worsen any level
above; what freedom is left goes to the rates nearest to the preferred (posture) rates.
"""

from __future__ import annotations

import daqp
import numpy as np

from robot.priority.levels import Plan

_SOFT_WEIGHTS = (1e-9, 1e-7, 1e-6)
"""Regularisation of a level's residual, the next one where the solver went in circles. At daqp's
default of 1e-6 a level that cannot be met is off by 4e-4 of its residual; at 1e-12 the solver
fails. At 1e-9 one problem in ten thousand ends with a level that is not at its best."""
_CYCLED = 3
_PRIMAL_TOLERANCE = 1e-9

_PER_POSITION_ERROR = 0.05
_PER_ORIENTATION_ERROR = 0.01
_DAMPING_MAX = 0.02


def error_damping(distance: float, angle: float) -> float:
    """Damping of the levels in proportion to the tip's error, as Levenberg and Marquardt have it.

    A command out of reach pushes against poses in which the tip cannot follow it at all to first
    order: a segment pulled straight, an arm stretched out. The linear model then asks for any speed
    and the sign changes every tick. The neglected second-order term is as large as the error, so
    damping by the error restores it; where the command can be followed the error, and with it the
    damping, is nothing. Without it, a pull beyond reach shakes the bend with 2700 rad/s^2 (rms);
    with it 17.

    Args:
        distance: position error left over from the last tick, m.
        angle: orientation error left over, rad.
    """
    return min(_DAMPING_MAX, _PER_POSITION_ERROR * distance + _PER_ORIENTATION_ERROR * angle)


class LexicographicProblem:
    """One plan's QP on memory that the caller fills.

    Rows stand as rates are bounded: the n unknowns themselves (a box), then the limit rows that
    couple them, then the plan's rows, level by level.

    Attributes:
        plan: the levels.
    """

    def __init__(
        self,
        plan: Plan,
        matrix: np.ndarray,
        upper: np.ndarray,
        lower: np.ndarray,
        limit_rows: int = 1,
    ) -> None:
        """Use the caller's memory.

        Args:
            plan: the levels, m rows in all.
            matrix: (>= limit_rows + m, n) the limit rows, then the plan's rows.
            upper: (>= n + limit_rows + m,) upper bounds: of the rates, of the limit rows, of the
                plan's rows.
            lower: (>= n + limit_rows + m,) lower bounds.
            limit_rows: how many rows beside the box stand above every level.
        """
        unknowns, count = matrix.shape[1], len(plan.rows)
        limits = unknowns + limit_rows
        self.plan = plan
        self._matrix = matrix[: limit_rows + count]
        self._upper, self._lower = upper[: limits + count], lower[: limits + count]
        self._hessian = np.eye(unknowns)
        self._linear = np.zeros(unknowns)
        self._sense = np.zeros(limits + count, dtype=np.int32)
        self._break_points = np.array([limits, *(limits + plan.starts[1:])], dtype=np.int32)

    def solve(self, preferred: np.ndarray, damping: float) -> tuple[np.ndarray, int]:
        """Rates (n,) and daqp's exit flag (positive: solved).

        Args:
            preferred: (n,) rates wanted where the levels leave freedom.
            damping: of every level, see :func:`error_damping`.

        Solved cold every time: a warm start gives rates that differ in the thirteenth digit, and a
        replay could not be compared bit for bit.
        """
        np.negative(preferred, out=self._linear)
        for weight in _SOFT_WEIGHTS:
            rates, _, flag, _ = daqp.solve(
                self._hessian,
                self._linear,
                self._matrix,
                self._upper,
                self._lower,
                self._sense,
                self._break_points,
                rho_soft=weight + damping,
                primal_tol=_PRIMAL_TOLERANCE,
            )
            if flag != _CYCLED:
                break
        return rates, flag
