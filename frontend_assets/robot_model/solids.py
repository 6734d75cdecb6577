"""Crisp parts: plates, cylinders, boxes with rounded edges, and their boolean combinations [mm]."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import manifold3d  # type: ignore[import-not-found]  # its stubs lie outside a package
import numpy as np
from numpy.typing import ArrayLike

from frontend_assets.robot_model.fields import Array
from frontend_assets.robot_model.shells import Faces, Shell, creased

Solid = Any
"""A ``manifold3d.Manifold``."""

_Manifold = manifold3d.Manifold

ROUND = 48
"""Facets around a large cylinder."""
SMALL = 12
"""Facets around a screw or a hole."""


def rod(start: ArrayLike, end: ArrayLike, radius: float, facets: int = ROUND) -> Solid:
    """A cylinder between two points [mm]."""
    a, b = np.array(start, float), np.array(end, float)
    height = float(np.linalg.norm(b - a))
    return placed(_Manifold.cylinder(height, radius, radius, facets), a, b - a)


def bevelled_rod(
    start: ArrayLike, end: ArrayLike, radius: float, bevel: float, facets: int = ROUND
) -> Solid:
    """A cylinder between two points [mm] whose rims are broken by ``bevel`` [mm]."""
    a, b = np.array(start, float), np.array(end, float)
    h = float(np.linalg.norm(b - a))
    r = radius
    outline = [[0, 0], [r - bevel, 0], [r, bevel], [r, h - bevel], [r - bevel, h], [0, h]]
    return placed(_Manifold.revolve(manifold3d.CrossSection([outline]), facets), a, b - a)


def ring(
    start: ArrayLike, end: ArrayLike, outer: float, inner: float, facets: int = ROUND
) -> Solid:
    """A tube between two points [mm]."""
    a, b = np.array(start, float), np.array(end, float)
    over = (b - a) / np.linalg.norm(b - a)
    return rod(a, b, outer, facets) - rod(a - over, b + over, inner, facets)


def block(low: Sequence[float], high: Sequence[float], edge: float = 0.0) -> Solid:
    """An axis-aligned box between two corners [mm], its edges rounded with radius ``edge`` [mm]."""
    a, b = np.array(low, float), np.array(high, float)
    if edge == 0:
        return _Manifold.cube(tuple(b - a)).translate(tuple(a))
    ball = _Manifold.sphere(edge, 12)
    corners = [
        ball.translate(tuple(np.where(side, b - edge, a + edge)))
        for side in np.ndindex(2, 2, 2)
    ]  # fmt: skip
    return _Manifold.batch_hull(corners)


def prism(outline: Sequence[Sequence[float]], low: float, high: float) -> Solid:
    """An outline in the x-y plane [mm] extruded from z = ``low`` to z = ``high``."""
    section = manifold3d.CrossSection([[list(p) for p in outline]])
    return _Manifold.extrude(section, high - low).translate((0.0, 0.0, low))


def placed(solid: Solid, origin: Array, axis: Array) -> Solid:
    """Turn the solid's z axis onto ``axis`` and move its origin to ``origin`` [mm]."""
    z = axis / np.linalg.norm(axis)
    helper = np.array([1.0, 0, 0]) if abs(z[0]) < 0.9 else np.array([0, 1.0, 0])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return moved(solid, np.column_stack([x, np.cross(z, x), z]), origin)


def moved(solid: Solid, rotation: Array, origin: ArrayLike) -> Solid:
    """Apply a rotation (3, 3), then a translation (3,) [mm]."""
    return solid.transform(np.column_stack([rotation, np.array(origin, float)]))


def merged(solids: Sequence[Solid]) -> Solid:
    """Union of all."""
    return _Manifold.batch_boolean(list(solids), manifold3d.OpType.Add)


def shell_of(solid: Solid) -> Shell:
    """Mesh of a solid: crisp edges where flat faces meet, smooth where facets are round."""
    return creased(*arrays_of(solid))


def solid_of(vertices: Array, faces: Faces) -> Solid:
    """A solid from a closed mesh."""
    mesh = manifold3d.Mesh64(
        vert_properties=np.ascontiguousarray(vertices, np.float64),
        tri_verts=np.ascontiguousarray(faces, np.uint64),
    )
    return _Manifold(mesh)


def arrays_of(solid: Solid) -> tuple[Array, Faces]:
    """Vertices (n, 3) and faces (m, 3) of a solid."""
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts).astype(np.int64)
