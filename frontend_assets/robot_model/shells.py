"""Triangle meshes with normals: smooth where the part is round, crisp where flat faces meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from frontend_assets.robot_model.fields import Array

Faces = NDArray[np.int64]

_CREASE_COSINE = float(np.cos(np.radians(32.0)))


class Shell(NamedTuple):
    """A triangle mesh with a normal for every vertex; vertices are doubled along creases.

    Vertices [mm] and normals have shape (n, 3), faces (m, 3), counter-clockwise from outside.
    """

    vertices: Array
    normals: Array
    faces: Faces


def creased(vertices: Array, faces: Faces) -> Shell:
    """Give a mesh normals: smooth over round parts, split along edges sharper than 32 degrees."""
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled_area = np.linalg.norm(cross, axis=1)
    keep = doubled_area > 1e-9
    faces, corners, cross = faces[keep], corners[keep], cross[keep]
    normal = cross / doubled_area[keep][:, None]
    angle = np.column_stack([_corner_angle(corners, c) for c in range(3)]).ravel()
    owner = faces.ravel()
    face_of = np.repeat(np.arange(len(faces)), 3)
    first, second = _pairs_of_equal(owner)
    near = np.einsum("ij,ij->i", normal[face_of[first]], normal[face_of[second]]) > _CREASE_COSINE
    first, second = first[near], second[near]
    total = np.zeros((len(owner), 3))
    np.add.at(total, first, normal[face_of[second]] * angle[second][:, None])
    total /= np.linalg.norm(total, axis=1)[:, None]
    key = np.column_stack([owner, np.round(total * 1e3).astype(np.int64)])
    _, index, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Shell(vertices[owner[index]], total[index], inverse.reshape(-1, 3))


def joined(shells: Sequence[Shell]) -> Shell:
    """Several shells as one."""
    offsets = np.cumsum([0, *(len(shell.vertices) for shell in shells)])
    return Shell(
        np.vstack([shell.vertices for shell in shells]),
        np.vstack([shell.normals for shell in shells]),
        np.vstack([s.faces + o for s, o in zip(shells, offsets, strict=False)]),
    )


def _corner_angle(corners: Array, c: int) -> Array:
    to_next = corners[:, (c + 1) % 3] - corners[:, c]
    to_last = corners[:, (c + 2) % 3] - corners[:, c]
    across = np.linalg.norm(np.cross(to_next, to_last), axis=1)
    return np.asarray(np.arctan2(across, np.einsum("ij,ij->i", to_next, to_last)))


def _pairs_of_equal(owner: Faces) -> tuple[Faces, Faces]:
    """Index pairs (i, j), also i = j, with ``owner[i] == owner[j]``."""
    order = np.argsort(owner, kind="stable")
    counts = np.bincount(owner)
    counts = counts[counts > 0]
    start = np.repeat(np.cumsum(counts) - counts, counts)
    size = np.repeat(counts, counts)
    first = np.repeat(np.arange(len(owner)), size)
    within = np.arange(len(first)) - np.repeat(np.cumsum(size) - size, size)
    return order[first], order[np.repeat(start, size) + within]
