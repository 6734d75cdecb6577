"""How far the instrument is from what stands before it: for drawing, and to check paths.

The instrument is a chain of spheres as thick as its disks along its axis; the last one ends at the
tip's foremost point.
"""

from __future__ import annotations

import numpy as np

from robot.configuration import Instrument
from robot.rotations import matrix_from_quaternion
from robot.segment import tip_position
from scenes.boards.solids import Solid

_SEGMENT_POINTS = 28
_SHAFT_STEP = 0.002


def instrument_axis(
    instrument: Instrument,
    shaft_base: np.ndarray,
    shaft_end: np.ndarray,
    shaft_rotation: np.ndarray,
    uv: np.ndarray,
) -> np.ndarray:
    """Points along the axis of shaft and segment.

    Args:
        instrument: dimensions.
        shaft_base: (3,) base frame, m.
        shaft_end: (3,) base frame, m.
        shaft_rotation: (3, 3) frame of the segment's base, base frame.
        uv: (2,) bend, rad.

    Returns:
        (n, 3) base frame, m; the last one is the centre of the tip's rounded end.
    """
    length = instrument.segment_length_m
    last = 1.0 - 0.5 * instrument.disk_diameter_m / length
    segment = np.empty((_SEGMENT_POINTS, 3))
    for place, fraction in zip(segment, np.linspace(0.0, last, _SEGMENT_POINTS), strict=True):
        tip_position(float(uv[0] * fraction), float(uv[1] * fraction), length * fraction, place)
    pieces = round(instrument.shaft_length_m / _SHAFT_STEP)
    along = np.linspace(0.0, 1.0, pieces, endpoint=False)[:, None]
    shaft = shaft_base + along * (shaft_end - shaft_base)
    return np.concatenate([shaft, shaft_end + segment @ shaft_rotation.T])


def distances(solid: Solid, points: np.ndarray) -> np.ndarray:
    """Distances (n,) in m of points (n, 3), base frame, from the surface; negative inside."""
    rotation = np.empty((3, 3))
    matrix_from_quaternion(solid.wxyz, rotation)
    local = (points - solid.position) @ rotation
    if solid.kind == "box":
        outside = np.abs(local) - solid.size
    elif solid.kind == "cylinder":
        radial = np.hypot(local[:, 0], local[:, 1]) - solid.size[0]
        outside = np.column_stack([radial, np.abs(local[:, 2]) - solid.size[1]])
    else:
        half_length = solid.size[1] if solid.kind == "capsule" else 0.0
        local[:, 2] -= np.clip(local[:, 2], -half_length, half_length)
        around: np.ndarray = np.linalg.norm(local, axis=1) - solid.size[0]
        return around
    away: np.ndarray = np.linalg.norm(np.maximum(outside, 0.0), axis=1)
    away += np.minimum(outside.max(axis=1), 0.0)
    return away
