"""The way from where the tip is to where a path shall start.

A short one is straight. From farther off the tip first goes back along its own axis, out of
whatever it is in, then in an arch over what may lie between, and last along its axis to the start.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robot.commands import rotation_error
from robot.rotations import exponential, matrix_from_quaternion, quaternion_from_matrix
from scenes.path import Path

SLOWEST_S = 3.0
SPEED_M_S = 0.010
TURN_RAD_S = math.radians(10.0)
NEAR_M = 0.005
"""Up to this far off the way is straight."""
RETREAT_M = 0.006
"""That the tip goes along its own axis, at both ends of a longer way."""
ARCH_M = 0.015
"""Height of the arch over the straight line, along the base's z."""
_SAMPLES_PER_SECOND = 50


class _Leg(NamedTuple):
    """From rest to rest: ends (3,) and arch in m; shares of the whole turn at both ends."""

    duration_s: float
    begin: np.ndarray
    end: np.ndarray
    turn_begin: float
    turn_end: float
    arch_m: float


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
    """``path`` as if it began at the start pose, with a way there from where the tip is.

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
    legs = _legs(offset, angle, tip_rotation[:, 2], start_rotation[:, 2])
    duration = sum(leg.duration_s for leg in legs)
    way = _way(legs, vector)
    rows = np.zeros((len(way) + len(path.samples), 8))
    rows[: len(way)] = way
    rest = rows[len(way) :]
    rest[:, 0] = path.samples[:, 0] + duration
    rest[:, 1:4] = path.samples[:, 1:4] + offset
    back = start_rotation @ tip_rotation.T
    for row, sample in zip(rest, path.samples, strict=True):
        matrix_from_quaternion(sample[4:8], turn)
        quaternion_from_matrix(np.ascontiguousarray(turn @ back), row[4:8])
    return Path(rows, path.name), duration


def _legs(offset: np.ndarray, angle: float, axis: np.ndarray, last_axis: np.ndarray) -> list[_Leg]:
    """The parts of the way; ``axis`` and ``last_axis`` (3,) are the tip's at both ends."""
    here, distance = np.zeros(3), float(np.linalg.norm(offset))
    if distance <= NEAR_M:
        return [_Leg(lead_in_s(distance, angle), here, offset, 0.0, 1.0, 0.0)]
    behind, before = -RETREAT_M * axis, offset - RETREAT_M * last_axis
    over = float(np.linalg.norm(before - behind)) + 2.0 * ARCH_M
    return [
        _Leg(lead_in_s(RETREAT_M, 0.0), here, behind, 0.0, 0.0, 0.0),
        _Leg(lead_in_s(over, angle), behind, before, 0.0, 1.0, ARCH_M),
        _Leg(lead_in_s(RETREAT_M, 0.0), before, offset, 1.0, 1.0, 0.0),
    ]


def _way(legs: list[_Leg], vector: np.ndarray) -> np.ndarray:
    """Samples (n, 8) of the legs but for the end of the last; ``vector`` (3,): the whole turn."""
    parts, passed, turn = [], 0.0, np.empty((3, 3))
    for leg in legs:
        count = round(leg.duration_s * _SAMPLES_PER_SECOND)
        share = np.arange(count) / count
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        rows = np.zeros((count, 8))
        rows[:, 0] = passed + share * leg.duration_s
        rows[:, 1:4] = leg.begin + smooth[:, None] * (leg.end - leg.begin)
        rows[:, 3] += leg.arch_m * np.sin(math.pi * smooth)
        for row, part in zip(rows, smooth, strict=True):
            exponential((leg.turn_begin + part * (leg.turn_end - leg.turn_begin)) * vector, turn)
            quaternion_from_matrix(turn, row[4:8])
        parts.append(rows)
        passed += leg.duration_s
    return np.concatenate(parts)
