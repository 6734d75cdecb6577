"""How the stability determinant changes with the tubes: what keeps a motion away from snapping."""

from __future__ import annotations

import numpy as np

from robot.compiled import compiled
from robot.concentric.sections import walk
from robot.concentric.state import state_at_exit

_STEP = 1e-6


@compiled
def _determinant(q: np.ndarray, torsion: np.ndarray, tubes: np.ndarray) -> float:
    """Of the torsion rates at the ends by those at the exit, see ``robot.concentric.stability``."""
    count = len(tubes)
    residual, change = np.empty(count), np.empty((count, 3 * count))
    walk(state_at_exit(q, torsion), q, tubes, 1.0, 2 * count, False, residual, change)
    return float(np.linalg.det(np.ascontiguousarray(change[:, 2 * count :])))


@compiled
def stability_slope(
    q: np.ndarray,
    torsion: np.ndarray,
    torsion_change: np.ndarray,
    tubes: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Derivative of an arm's stability determinant by its tubes, along the solution that is held.

    Args:
        q: (2n,) translations in m, rotations in rad.
        torsion: (n,) torsion rates at the exit, rad/m, solved.
        torsion_change: (n, 2n) their derivative by q.
        tubes: (n,) ``TUBE``.
        slope: (2n,) filled, 1/m and 1/rad.
    """
    moved, carried = q.copy(), torsion.copy()
    for place in range(q.size):
        values = np.empty(2)
        for side in range(2):
            step = _STEP if side == 0 else -_STEP
            moved[place] = q[place] + step
            for index in range(torsion.size):
                carried[index] = torsion[index] + step * torsion_change[index, place]
            values[side] = _determinant(moved, carried, tubes)
        moved[place] = q[place]
        slope[place] = (values[0] - values[1]) / (2.0 * _STEP)
