"""Three numbers as a tuple: compiled code keeps them in registers and allocates nothing."""

from __future__ import annotations

import numpy as np

from robot.compiled import compiled

Triple = tuple[float, float, float]


@compiled
def column(matrix: np.ndarray, index: int) -> Triple:
    """Column ``index`` of ``matrix`` (3, m)."""
    return matrix[0, index], matrix[1, index], matrix[2, index]


@compiled
def cross(a: Triple, b: Triple) -> Triple:
    """Cross product a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def combine(x: float, a: Triple, y: float, b: Triple) -> Triple:
    """Combination x a + y b."""
    return x * a[0] + y * b[0], x * a[1] + y * b[1], x * a[2] + y * b[2]


@compiled
def add_to_column(matrix: np.ndarray, index: int, scale: float, vector: Triple) -> None:
    """Add ``scale`` times ``vector`` to column ``index`` of ``matrix`` (3, m)."""
    matrix[0, index] += scale * vector[0]
    matrix[1, index] += scale * vector[1]
    matrix[2, index] += scale * vector[2]
