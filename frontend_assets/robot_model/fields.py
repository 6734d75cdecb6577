"""Shapes as fields: a function from points to (nearly) their signed distance from the surface.

All lengths in millimetres, in the frame of the link that is being modelled. Negative is inside.
Smooth unions give the moulded fillets that a robot arm's castings have.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Field = Callable[[Array], Array]
"""Points of shape (n, 3) [mm] to distances of shape (n,) [mm]."""

_SAMPLES_PER_SPAN = 10


def limb(points: Sequence[Sequence[float]], radii: Sequence[float]) -> Field:
    """A round tube along a smooth curve through ``points`` with spherical ends.

    Args:
        points: at least two points on the centre line, shape (n, 3) [mm].
        radii: radius at each point, shape (n,) [mm].
    """
    line = _smooth_curve(np.column_stack([np.array(points, float), np.array(radii, float)]))

    def field(p: Array) -> Array:
        best = np.full(len(p), np.inf)
        for (*a, ra), (*b, rb) in pairwise(line):
            axis = np.subtract(b, a)
            t = np.clip((p - a) @ axis / (axis @ axis), 0, 1)
            away = np.linalg.norm(p - a - t[:, None] * axis, axis=1)
            best = np.minimum(best, away - (ra + t * (rb - ra)))
        return best

    return field


def _smooth_curve(points: Array) -> Array:
    """Catmull-Rom curve through ``points``, shape (n, 4) to (m, 4)."""
    padded = np.vstack([2 * points[0] - points[1], points, 2 * points[-1] - points[-2]])
    t = np.linspace(0, 1, _SAMPLES_PER_SPAN, endpoint=False)[:, None]
    pieces = []
    for p0, p1, p2, p3 in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        slope1, slope2 = (p2 - p0) / 2, (p3 - p1) / 2
        cubic = 2 * (p1 - p2) + slope1 + slope2
        square = 3 * (p2 - p1) - 2 * slope1 - slope2
        pieces.append(((cubic * t + square) * t + slope1) * t + p1)
    return np.vstack([*pieces, points[-1:]])


def drum(start: ArrayLike, end: ArrayLike, radius: float, edge: float) -> Field:
    """A cylinder from ``start`` to ``end`` [mm], its rims rounded with radius ``edge`` [mm]."""
    a, b = np.array(start, float), np.array(end, float)
    half = np.linalg.norm(b - a) / 2
    axis = (b - a) / (2 * half)

    def field(p: Array) -> Array:
        from_middle = p - (a + b) / 2
        along = from_middle @ axis
        across = np.linalg.norm(from_middle - along[:, None] * axis, axis=1)
        q = np.column_stack([across - radius + edge, np.abs(along) - half + edge])
        outside = np.linalg.norm(np.maximum(q, 0), axis=1)
        return np.asarray(outside + np.minimum(q.max(axis=1), 0) - edge)

    return field


def above(point: ArrayLike, normal: ArrayLike) -> Field:
    """The half space on the side of ``point`` [mm] that ``normal`` points to."""
    n = np.array(normal, float) / np.linalg.norm(normal)
    origin = np.array(point, float)
    return lambda p: -((p - origin) @ n)


def stretched(field: Field, centre: ArrayLike, factors: ArrayLike) -> Field:
    """``field`` scaled by ``factors`` (3,) about ``centre`` [mm]; distances become approximate."""
    middle, scale = np.array(centre, float), np.array(factors, float)
    return lambda p: field(middle + (p - middle) / scale) * float(scale.min())


def union(*fields: Field) -> Field:
    """Everything in any of the shapes, with sharp inner corners."""
    return lambda p: np.minimum.reduce([field(p) for field in fields])


def melt(first: Field, second: Field, fillet: float) -> Field:
    """Union of two shapes whose inner corners are filled over about ``fillet`` [mm]."""

    def field(p: Array) -> Array:
        a, b = first(p), second(p)
        overlap = np.maximum(fillet - np.abs(a - b), 0) / fillet
        return np.asarray(np.minimum(a, b) - overlap**2 * fillet / 4)

    return field


def common(first: Field, second: Field, rounding: float) -> Field:
    """What is in both shapes; the edges that arise are rounded over about ``rounding`` [mm]."""
    inverse = melt(lambda p: -first(p), lambda p: -second(p), rounding)
    return lambda p: -inverse(p)
