"""The tip stands in a ring and presses against its side, harder and harder."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from robot.configuration import Configuration
from scenes.boards.place import place
from scenes.boards.ring_board import ring_board
from scenes.experiments.rings import STANDOFF_M, pointing
from scenes.experiments.timing import minimum_jerk, still, times

RING = 2
"""Which ring, counted from 0: one that stands across the instrument's way."""
DEPTHS_M = (0.0055, 0.0080, 0.0110, 0.0140, 0.0165)
"""How far the desired tip goes to the left of the ring's axis, level after level: 0.1 to 0.45 N on
the ring for the preset ``paper``."""

_APPROACH_S, _IN_S, _LEVEL_S, _MOVE_S, _OUT_S = 5.0, 3.0, 4.0, 1.5, 3.0
_BEYOND_M = 0.003
_HOLD_S = 1.0


def press_times(_configuration: Configuration) -> tuple[float, ...]:
    """When the tip has pressed at each level for a while, s."""
    begin = _APPROACH_S + _IN_S
    return tuple(begin + (level + 1) * _LEVEL_S - _HOLD_S for level in range(len(DEPTHS_M)))


def ring_press(configuration: Configuration) -> np.ndarray:
    """Into the ring along its axis, aside level by level, and back: samples (n, 8)."""
    here, ring = place(configuration), ring_board(configuration).rings[RING]
    begin = _APPROACH_S + _IN_S
    back = begin + len(DEPTHS_M) * _LEVEL_S
    samples = still(times(back + _MOVE_S + _OUT_S))
    instants = samples[:, 0]
    up = np.array([0.0, 0.0, 1.0]) - ring.axis[2] * ring.axis
    left = np.cross(up / np.linalg.norm(up), ring.axis)
    approach = minimum_jerk(instants / _APPROACH_S)
    inward = minimum_jerk((instants - _APPROACH_S) / _IN_S)
    outward = minimum_jerk((instants - back - _MOVE_S) / _OUT_S)
    aside = np.zeros(len(instants))
    for level, step in enumerate(np.diff((0.0, *DEPTHS_M))):
        aside += step * minimum_jerk((instants - begin - level * _LEVEL_S) / _MOVE_S)
    aside -= DEPTHS_M[-1] * minimum_jerk((instants - back) / _MOVE_S)
    samples[:, 1:4] = approach[:, None] * (ring.centre - STANDOFF_M * ring.axis - here.tip)
    samples[:, 1:4] += ((STANDOFF_M + _BEYOND_M) * (inward - outward))[:, None] * ring.axis
    samples[:, 1:4] += aside[:, None] * left
    turn = pointing(here.tip_rotation[:, 2], ring.axis)
    turning = Slerp([0.0, 1.0], Rotation.concatenate([Rotation.identity(), turn]))
    samples[:, 4:8] = turning(approach).as_quat()[:, [3, 0, 1, 2]]
    return samples
