"""Circles and the square: the tip moves in a plane."""

from __future__ import annotations

import math

import numpy as np

from robot.configuration import Configuration
from robot.rotations import exponential, quaternion_from_matrix
from robot.start import start_tip_rotation
from scenes.boards.pegboard import CORNERS
from scenes.experiments.timing import cruise, minimum_jerk, still, times

_CIRCLE_RADIUS_M = 0.015
_SWEEP_RAD = math.radians(40.0)


def circle(
    duration_s: float, ramp_s: float, towards: tuple[float, float, float], second: int
) -> np.ndarray:
    """A 3 cm circle through the start: samples (n, 8).

    Args:
        duration_s: of one turn.
        ramp_s: over which it gathers and loses its speed; 0 for an even speed throughout.
        towards: unit vector, base frame, from the start to the centre.
        second: base axis along which the motion begins.
    """
    samples = still(times(duration_s))
    angle = 2.0 * math.pi * cruise(samples[:, 0] / duration_s, ramp_s / duration_s)
    samples[:, 1:4] = _CIRCLE_RADIUS_M * np.outer(1.0 - np.cos(angle), towards)
    samples[:, 1 + second] += _CIRCLE_RADIUS_M * np.sin(angle)
    return samples


def square(side_s: float) -> np.ndarray:
    """From peg to peg in the base's x-y plane, from rest to rest on every side: samples (n, 8)."""
    corners = np.concatenate([CORNERS, CORNERS[:1]])
    samples = still(times(4 * side_s))
    side = np.minimum((samples[:, 0] // side_s).astype(int), 3)
    smooth = minimum_jerk(samples[:, 0] / side_s - side)
    samples[:, 1:3] = corners[side] + smooth[:, None] * (corners[side + 1] - corners[side])
    return samples


def circle_infeasible(configuration: Configuration) -> np.ndarray:
    """The circle in 8 s while the tip shall also turn 40 degrees about its own y axis and back."""
    samples = circle(8.0, 0.0, (-1.0, 0.0, 0.0), 1)
    start = start_tip_rotation(configuration)
    turn, own = np.empty((3, 3)), np.empty(4)
    for row in samples:
        angle = 0.5 * _SWEEP_RAD * (1.0 - math.cos(2.0 * math.pi * row[0] / 8.0))
        exponential(np.array([0.0, angle, 0.0]), turn)
        quaternion_from_matrix(start @ turn @ start.T, own)
        row[4:8] = own
    return samples
