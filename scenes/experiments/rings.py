"""The tip goes half-way through the rings, one after the other (paper, section 5.4, Fig. 14)."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from robot.configuration import Configuration
from scenes.boards.place import place
from scenes.boards.ring_board import ring_board
from scenes.experiments.timing import minimum_jerk, still, times

RING_S = 12.0
"""For each ring."""

_APPROACH_S, _IN_S, _REST_S, _OUT_S = 5.0, 3.0, 1.0, 3.0
STANDOFF_M = 0.010
"""Of the tip before a ring, on its axis, m."""
_BEYOND_M = 0.003
"""The tip's foremost point goes this far past the ring's plane: its full width stands in it."""


def half_way_times(configuration: Configuration) -> tuple[float, ...]:
    """When the tip is half-way through each ring, s."""
    middle = _APPROACH_S + _IN_S + 0.5 * _REST_S
    return tuple(index * RING_S + middle for index in range(len(ring_board(configuration).rings)))


def pointing(start: np.ndarray, axis: np.ndarray) -> Rotation:
    """The shortest turn that takes the unit vector ``start`` to ``axis``."""
    cross = np.cross(start, axis)
    sine = float(np.linalg.norm(cross))
    if sine < 1e-9:
        return Rotation.identity()
    return Rotation.from_rotvec(cross * (np.arctan2(sine, float(start @ axis)) / sine))


def ring_path(configuration: Configuration) -> np.ndarray:
    """To each ring along its axis, in, out the same way, to the next: samples (n, 8)."""
    here, rings = place(configuration), ring_board(configuration).rings
    samples = still(times(len(rings) * RING_S))
    instants = samples[:, 0]
    position, turn = np.zeros(3), Rotation.identity()
    for index, ring in enumerate(rings):
        now = (instants >= index * RING_S) & (instants <= (index + 1) * RING_S)
        local = instants[now] - index * RING_S
        goal = ring.centre - STANDOFF_M * ring.axis - here.tip
        turned = pointing(here.tip_rotation[:, 2], ring.axis)
        approach = minimum_jerk(local / _APPROACH_S)
        inward = minimum_jerk((local - _APPROACH_S) / _IN_S)
        outward = minimum_jerk((local - (RING_S - _OUT_S)) / _OUT_S)
        depth = (STANDOFF_M + _BEYOND_M) * (inward - outward)
        samples[now, 1:4] = position + approach[:, None] * (goal - position)
        samples[now, 1:4] += depth[:, None] * ring.axis
        turning = Slerp([0.0, 1.0], Rotation.concatenate([turn, turned]))
        samples[now, 4:8] = turning(approach).as_quat()[:, [3, 0, 1, 2]]
        position, turn = goal, turned
    return samples
