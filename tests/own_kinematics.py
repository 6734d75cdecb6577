"""The robot's geometry once more, in other words than the program's.

Modified (Craig) DH of the paper's Table 2 instead of the URDF, homogeneous transforms, and the
segment as Rz(-delta) Ry(phi) Rz(delta) of its polar coordinates. Shares no code with ``robot``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration

# alpha_(k-1) in quarter turns, a_(k-1) and d_k in m.
TABLE_2 = (
    (0, 0.0, 0.267),
    (-1, 0.0, 0.0),
    (1, 0.0, 0.293),
    (1, 0.0525, 0.0),
    (1, 0.0775, 0.3425),
    (1, 0.0, 0.0),
    (-1, 0.076, 0.097),
)


class Pose(NamedTuple):
    """Tip and shaft in the base frame, m."""

    tip: np.ndarray
    rotation: np.ndarray
    shaft_base: np.ndarray
    shaft_end: np.ndarray


def _about(axis: int, angle: float) -> np.ndarray:
    """(3, 3) rotation about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    following, last = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[following, following] = matrix[last, last] = c
    matrix[following, last], matrix[last, following] = -s, s
    return matrix


def flange(q: np.ndarray) -> np.ndarray:
    """(4, 4) transform of frame 7 at joint angles ``q`` (7,)."""
    total = np.eye(4)
    for (quarters, a, d), angle in zip(TABLE_2, q, strict=True):
        turn, step = _about(0, 0.5 * math.pi * quarters), np.eye(4)
        step[:3, :3] = turn @ _about(2, angle)
        step[:3, 3] = turn @ [a, 0.0, d]
        total = total @ step
    return total


def segment(theta: float, delta: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Tip (3,) and rotation (3, 3) of the continuum segment in its base frame."""
    phi = 0.5 * math.pi - theta
    rotation = _about(2, -delta) @ _about(1, phi) @ _about(2, delta)
    if phi == 0.0:
        return np.array([0.0, 0.0, length]), rotation
    lean = length * (1.0 - math.cos(phi)) / phi
    position = [lean * math.cos(delta), -lean * math.sin(delta), length * math.sin(phi) / phi]
    return np.array(position), rotation


def pose(configuration: Configuration, q: np.ndarray, theta: float, delta: float) -> Pose:
    """Where everything is at ``q`` (7,), ``theta``, ``delta``."""
    module, instrument = configuration.module, configuration.instrument
    hand = flange(q)
    z, x = np.array(module.shaft_direction), np.array(module.bend_direction)
    shaft = hand[:3, :3] @ np.column_stack([x, np.cross(z, x), z])
    base = hand[:3, :3] @ np.array(module.shaft_base_m) + hand[:3, 3]
    end = base + instrument.shaft_length_m * shaft[:, 2]
    local, turn = segment(theta, delta, instrument.segment_length_m)
    return Pose(end + shaft @ local, shaft @ turn, base, end)


def pose_at(configuration: Configuration, x: np.ndarray) -> Pose:
    """Where everything is at the augmented configuration ``x`` (10,)."""
    phi = math.hypot(x[7], x[8])
    return pose(configuration, x[:7], 0.5 * math.pi - phi, math.atan2(x[8], x[7]))


def distance_from_axis(point: np.ndarray, base: np.ndarray, end: np.ndarray) -> float:
    """Perpendicular distance of ``point`` from the line through ``base`` and ``end``, m."""
    along = (end - base) / np.linalg.norm(end - base)
    return float(np.linalg.norm(np.cross(along, point - base)))


def angle_between(left: np.ndarray, right: np.ndarray) -> float:
    """Angle between two rotation matrices, rad."""
    return float(Rotation.from_matrix(left @ right.T).magnitude())
