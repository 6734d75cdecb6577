"""From a field to a smooth, closed triangle mesh with flat joint faces and true normals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from frontend_assets.robot_model.fields import Array, Field
from frontend_assets.robot_model.shells import Faces, Shell, creased
from frontend_assets.robot_model.solids import arrays_of, rod, solid_of

_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b) in (1, 2, 4)]
_RELAXATIONS = 6
_AGREEMENT = 0.85
"""Cosine between mesh and field normal above which both mean the same face."""
_CHORD = 0.4
"""How far [mm] a chord of the mesh may run inside the true surface."""


class Cut(NamedTuple):
    """A joint face: within ``radius`` [mm] of its axis the shape ends at ``point`` [mm].

    What lies beyond along ``normal``, as far as ``reach`` [mm], is removed.
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    radius: float
    reach: float = 200.0


def moulded(
    field: Field, low: Sequence[float], high: Sequence[float], cuts: Sequence[Cut], cell: float
) -> Shell:
    """Mesh the zero surface of a field inside a box and end it flat at the cuts.

    Args:
        field: the shape; what reaches out of the box is cut off somewhere at its sides.
        low: lower corner of the box [mm]; cuts should lie well inside it.
        high: upper corner of the box [mm].
        cuts: planes at which joint faces arise.
        cell: size of the triangles [mm].
    """
    box = np.array(low, float), np.array(high, float)
    closed = _inside_box(field, box[0] + 1.5 * cell, box[1] - 1.5 * cell)
    vertices, faces = _surface_net(closed, *box, cell)
    vertices = _relaxed(closed, vertices, faces)
    solid = solid_of(vertices, faces)
    for cut in cuts:
        solid -= rod(cut.point, np.add(cut.point, np.multiply(cut.reach, cut.normal)), cut.radius)
    vertices, faces = arrays_of(solid)
    shell = creased(vertices, faces)
    return _with_field_normals(field, shell, cuts)


def _inside_box(field: Field, low: Array, high: Array) -> Field:
    def closed(p: Array) -> Array:
        return np.asarray(np.maximum(field(p), np.maximum(low - p, p - high).max(axis=1)))

    return closed


def _surface_net(field: Field, low: Array, high: Array, cell: float) -> tuple[Array, Faces]:
    """One vertex in every cell that the surface crosses, one quad for every crossed edge."""
    shape = np.ceil((high - low) / cell).astype(int) + 1
    nodes = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1)
    value = field(low + cell * nodes.reshape(-1, 3)).reshape(shape)
    corner = np.stack(
        [value[i : shape[0] - 1 + i, j : shape[1] - 1 + j, k : shape[2] - 1 + k]
         for i, j, k in _CORNERS], axis=-1,
    )  # fmt: skip
    crossed = (corner < 0).any(-1) & (corner >= 0).any(-1)
    cells = np.argwhere(crossed)
    number = np.full(crossed.shape, -1)
    number[crossed] = np.arange(len(cells))
    vertices = low + cell * (cells + _middle_of_crossings(corner[crossed]))
    return vertices, _quads(value < 0, number)


def _middle_of_crossings(corner: Array) -> Array:
    total, count = np.zeros((len(corner), 3)), np.zeros(len(corner))
    for a, b in _EDGES:
        va, vb = corner[:, a], corner[:, b]
        change = (va < 0) != (vb < 0)
        t = np.where(change, va / np.where(change, va - vb, 1), 0)
        place = _CORNERS[a] + t[:, None] * (_CORNERS[b] - _CORNERS[a])
        total[change] += place[change]
        count += change
    return total / count[:, None]


def _quads(inside: NDArray[np.bool_], number: Faces) -> Faces:
    faces = []
    for axis in range(3):
        other = [(axis + 1) % 3, (axis + 2) % 3]
        start = inside.take(range(inside.shape[axis] - 1), axis)
        end = inside.take(range(1, inside.shape[axis]), axis)
        edges = np.argwhere(start != end)
        ring = []
        for back in ((0, 0), (1, 0), (1, 1), (0, 1)):
            index = edges.copy()
            index[:, other[0]] -= back[0]
            index[:, other[1]] -= back[1]
            ring.append(number[tuple(index.T)])
        quad = np.column_stack(ring)
        flip = ~start[tuple(edges.T)]
        quad[flip] = quad[flip][:, ::-1]
        faces += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return np.vstack(faces)


def _gradient(field: Field, points: Array) -> Array:
    step = 1e-3
    parts = [(field(points + e) - field(points - e)) / (2 * step) for e in step * np.eye(3)]
    return np.column_stack(parts)


def _relaxed(field: Field, vertices: Array, faces: Faces) -> Array:
    """Spread vertices evenly and put each exactly on the surface."""
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    for _ in range(_RELAXATIONS):
        total, count = np.zeros_like(vertices), np.zeros(len(vertices))
        np.add.at(total, edges[:, 0], vertices[edges[:, 1]])
        np.add.at(count, edges[:, 0], 1)
        vertices = vertices + 0.6 * (total / count[:, None] - vertices)
        for _ in range(2):
            slope = _gradient(field, vertices)
            square = np.maximum(np.einsum("ij,ij->i", slope, slope), 1e-3)
            vertices = vertices - (field(vertices) / square)[:, None] * slope
    return vertices


def _with_field_normals(field: Field, shell: Shell, cuts: Sequence[Cut]) -> Shell:
    """The field's own normals everywhere but on the flat faces at the cuts."""
    slope = _gradient(field, shell.vertices)
    length = np.linalg.norm(slope, axis=1)
    on_cut = np.zeros(len(shell.vertices), bool)
    for cut in cuts:
        normal = np.array(cut.normal, float)
        flat = shell.normals @ normal > 0.999
        on_cut |= flat & (np.abs((shell.vertices - np.array(cut.point)) @ normal) < 1e-6)
    on_surface = np.abs(field(shell.vertices)) < _CHORD
    agrees = np.einsum("ij,ij->i", slope, shell.normals) > _AGREEMENT * length
    use = ~on_cut & (length > 0.3) & on_surface & agrees
    normals = shell.normals.copy()
    normals[use] = slope[use] / length[use][:, None]
    return Shell(shell.vertices, normals, shell.faces)
