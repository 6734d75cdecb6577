"""Small meshes of revolution for the scene, in metres about the local z axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.rotations import quaternion_from_matrix


class Mesh(NamedTuple):
    """Vertices (V, 3) float32 in m and triangles (F, 3) uint32, outward by the right-hand rule."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


def revolve(profile: Sequence[tuple[float, float]], sides: int, *, smooth: bool = False) -> Mesh:
    """Turn a polyline about z.

    Args:
        profile: (radius, height) corners in m. Walked upward (growing height) on the outside, the
            surface looks outward. A closed shape repeats its first corner at the end.
        sides: number of flat sides around.
        smooth: share the corners between the bands, so that the shading runs over them; otherwise
            every corner is a sharp edge.

    Returns:
        The surface; bands that touch the axis close there.
    """
    corners = np.asarray(profile, dtype=np.float64)
    bands = np.arange(len(corners) - 1)
    if smooth:
        rings, lower = corners, bands
    else:
        rings = np.stack([corners[:-1], corners[1:]], axis=1).reshape(-1, 2)
        lower = 2 * bands
    angles = np.arange(sides) * (2.0 * np.pi / sides)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    vertices = np.empty((len(rings), sides, 3))
    vertices[:, :, :2] = rings[:, None, :1] * around[None]
    vertices[:, :, 2] = rings[:, None, 1]
    side = np.arange(sides)
    following = (side + 1) % sides
    faces = []
    for band, first in enumerate(lower):
        low, high = first * sides, (first + 1) * sides
        if corners[band, 0] > 0.0:
            faces.append(np.stack([low + side, low + following, high + following], axis=1))
        if corners[band + 1, 0] > 0.0:
            faces.append(np.stack([low + side, high + following, high + side], axis=1))
    return Mesh(vertices.reshape(-1, 3).astype(np.float32), np.concatenate(faces).astype(np.uint32))


def ring(inner: float, outer: float, bottom: float, top: float, sides: int) -> Mesh:
    """A flat ring (annulus) between two radii and two heights, all in m."""
    corners = [(outer, bottom), (outer, top), (inner, top), (inner, bottom), (outer, bottom)]
    return revolve(corners, sides)


def round_bar(bottom: float, top: float, radius: float, edge: float, sides: int) -> Mesh:
    """A solid bar between two heights with edges broken by ``edge``, all in m."""
    corners = [
        (0.0, bottom),
        (radius - edge, bottom),
        (radius, bottom + edge),
        (radius, top - edge),
        (radius - edge, top),
        (0.0, top),
    ]
    return revolve(corners, sides)


def ball(radius: float, sides: int = 40) -> Mesh:
    """A ball around the origin, m."""
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, sides // 2)
    return revolve(ball_arc(radius, 0.0, angles), sides, smooth=True)


def ball_arc(
    radius: float, height: float, angles: NDArray[np.float64]
) -> list[tuple[float, float]]:
    """Corners of the profile of a ball around ``height``, at latitudes ``angles`` (rad)."""
    across = np.maximum(radius * np.cos(angles), 0.0)
    across[np.abs(np.cos(angles)) < 1e-9] = 0.0
    up = height + radius * np.sin(angles)
    return [(float(r), float(z)) for r, z in zip(across, up, strict=True)]


def merge(*meshes: Mesh) -> Mesh:
    """One mesh of several."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + np.uint32(offset) for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def quaternions_of(rotations: NDArray[np.float64]) -> NDArray[np.float32]:
    """Rotation matrices (n, 3, 3) as quaternions (n, 4) wxyz."""
    wxyzs = np.empty((len(rotations), 4))
    for rotation, wxyz in zip(rotations, wxyzs, strict=True):
        quaternion_from_matrix(np.ascontiguousarray(rotation), wxyz)
    return wxyzs.astype(np.float32)


def quaternions_from_z(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shortest turns that take z onto unit ``directions`` (n, 3), as quaternions (n, 4) wxyz."""
    x, y, z = directions.T
    turns = np.stack([np.maximum(1.0 + z, 1e-9), -y, x, np.zeros_like(z)], axis=1)
    lengths: NDArray[np.float64] = np.linalg.norm(turns, axis=1, keepdims=True)
    return turns / lengths
