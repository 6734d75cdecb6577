"""The way from where the tip is to where a path shall start."""

from __future__ import annotations

import math

import numpy as np

from robot.commands import rotation_error
from robot.rotations import exponential, matrix_from_quaternion, quaternion_from_matrix
from scenes.path import Path

SLOWEST_S = 3.0
SPEED_M_S = 0.010
TURN_RAD_S = math.radians(10.0)
_SAMPLES_PER_SECOND = 50


def lead_in_s(distance_m: float, angle_rad: float) -> float:
    """How long the way takes, s; time for slow corrections to settle is always left."""
    return max(SLOWEST_S, 2.0 * distance_m / SPEED_M_S, 2.0 * angle_rad / TURN_RAD_S)


def anchored(
    path: Path,
    start_position: np.ndarray,
    start_rotation: np.ndarray,
    tip_position: np.ndarray,
    tip_rotation: np.ndarray,
) -> tuple[Path, float]:
    """``path`` as if it began at the start pose, with a smooth way there from where the tip is.

    Args:
        path: relative to its start, as every path.
        start_position: (3,) where it shall start, base frame, m.
        start_rotation: (3, 3) likewise.
        tip_position: (3,) where the tip is.
        tip_rotation: (3, 3) likewise.

    Returns:
        The whole path, relative to where the tip is, and how long the way in takes, s.
    """
    vector, turn = np.empty(3), np.empty((3, 3))
    angle = rotation_error(start_rotation, tip_rotation, vector)
    offset = start_position - tip_position
    duration = lead_in_s(float(np.linalg.norm(offset)), angle)
    times = np.linspace(0.0, duration, round(duration * _SAMPLES_PER_SECOND) + 1)[:-1]
    share = times / duration
    smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    rows = np.zeros((len(times) + len(path.samples), 8))
    rows[: len(times), 0] = times
    rows[: len(times), 1:4] = smooth[:, None] * offset
    for row, part in zip(rows[: len(times)], smooth, strict=True):
        exponential(part * vector, turn)
        quaternion_from_matrix(turn, row[4:8])
    rest = rows[len(times) :]
    rest[:, 0] = path.samples[:, 0] + duration
    rest[:, 1:4] = path.samples[:, 1:4] + offset
    back = start_rotation @ tip_rotation.T
    for row, sample in zip(rest, path.samples, strict=True):
        matrix_from_quaternion(sample[4:8], turn)
        quaternion_from_matrix(np.ascontiguousarray(turn @ back), row[4:8])
    return Path(rows, path.name), duration
