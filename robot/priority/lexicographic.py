"""The levels as one lexicographic QP with all limits on top, solved by daqp.

Each level minimises its residual among the rates that keep the limits and do not worsen any level
above; what freedom is left goes to the rates nearest to the preferred (posture) rates.
"""

from __future__ import annotations

import daqp
import numpy as np

from robot.priority.levels import Plan

_SOFT_WEIGHT = 1e-9
"""Regularisation of a level's residual. At daqp's default of 1e-6 a level that cannot be met is off
by 4e-4 of its residual; at 1e-12 the solver fails."""
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
    """Memory of one plan's QP: fill it, then solve.

    Attributes:
        matrix: (1 + m, 10) constraint rows: the bend limit, then the plan's rows.
        upper: (11 + m,) upper bounds: of the rates, of the bend row, of the plan's rows.
        lower: (11 + m,) lower bounds.
        preferred: (10,) rates wanted where nothing else decides, negated.
    """

    def __init__(self, plan: Plan) -> None:
        count = len(plan.rows)
        self.plan = plan
        self.matrix = np.zeros((1 + count, 10))
        self.upper = np.zeros(11 + count)
        self.lower = np.full(11 + count, -1e30)
        self.preferred = np.zeros(10)
        self.level_matrix = self.matrix[1:]
        self.level_upper = self.upper[11:]
        self.level_lower = self.lower[11:]
        self._hessian = np.eye(10)
        self._sense = np.zeros(11 + count, dtype=np.int32)
        self._break_points = np.array([11, *(11 + plan.starts[1:])], dtype=np.int32)

    def solve(self, damping: float) -> tuple[np.ndarray, int]:
        """Rates (10,) and daqp's exit flag (positive: solved).

        Args:
            damping: of every level, see :func:`error_damping`.

        Solved cold every time: a warm start gives rates that differ in the thirteenth digit, and a
        replay could not be compared bit for bit.
        """
        rates, _, flag, _ = daqp.solve(
            self._hessian,
            self.preferred,
            self.matrix,
            self.upper,
            self.lower,
            self._sense,
            self._break_points,
            rho_soft=_SOFT_WEIGHT + damping,
            primal_tol=_PRIMAL_TOLERANCE,
        )
        return rates, flag
