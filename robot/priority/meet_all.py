"""The common case: everything asked for can be done at once.

Where all levels can be met together inside the limits, their order does not matter, and every
solver gives the same rates: the ones nearest to the preferred rates that meet them all. These need
one small Cholesky factorisation and no QP.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled

_INDEPENDENT = 1e-6
"""A row whose squared part independent of the rows above is a smaller share of it than this does
not count as independent; the QP then decides."""


@compiled
def _factorize(matrix: np.ndarray, factor: np.ndarray) -> bool:
    """Cholesky factor of ``matrix @ matrix.T``; False if the rows are (nearly) dependent."""
    rows = matrix.shape[0]
    for i in range(rows):
        for j in range(i + 1):
            value = 0.0
            for k in range(matrix.shape[1]):
                value += matrix[i, k] * matrix[j, k]
            square = value
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            if i == j:
                if not value > _INDEPENDENT * square:
                    return False
                factor[i, i] = math.sqrt(value)
            else:
                factor[i, j] = value / factor[j, j]
    return True


@compiled
def meet_all(
    matrix: np.ndarray,
    target: np.ndarray,
    preferred: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    bend_row: np.ndarray,
    rates: np.ndarray,
) -> bool:
    """Rates nearest to ``preferred`` that meet every row, if they lie strictly inside the limits.

    Args:
        matrix: (m, 10) rows of all levels.
        target: (m,) their wanted rates.
        preferred: (10,) rates wanted where the rows leave freedom.
        lower: (>= 10,) bounds of the rates.
        upper: (>= 11,) bounds of the rates, then of ``bend_row @ rates``.
        bend_row: (10,).
        rates: (10,) filled.

    Returns:
        False if the rows depend on each other or a limit is touched: then the order matters.
    """
    rows = matrix.shape[0]
    factor = np.empty((rows, rows))
    if not _factorize(matrix, factor):
        return False
    multipliers = np.empty(rows)
    for i in range(rows):
        value = target[i]
        for k in range(10):
            value -= matrix[i, k] * preferred[k]
        for j in range(i):
            value -= factor[i, j] * multipliers[j]
        multipliers[i] = value / factor[i, i]
    for i in range(rows - 1, -1, -1):
        value = multipliers[i]
        for j in range(i + 1, rows):
            value -= factor[j, i] * multipliers[j]
        multipliers[i] = value / factor[i, i]
    bend = 0.0
    for k in range(10):
        value = preferred[k]
        for i in range(rows):
            value += matrix[i, k] * multipliers[i]
        if not lower[k] < value < upper[k]:
            return False
        rates[k] = value
        bend += bend_row[k] * value
    return bool(bend < upper[10])
