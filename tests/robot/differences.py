"""Twists by central differences: what every Jacobian is held against."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

PoseOf = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Position (3,) and rotation (3, 3) at some coordinates (n,)."""


def twist_columns(pose: PoseOf, at: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """(6, n) twist of ``pose`` per rate of each coordinate, linear then angular."""
    columns = np.empty((6, len(at)))
    for index in range(len(at)):
        change = np.zeros(len(at))
        change[index] = step
        after, rotation_after = pose(at + change)
        before, rotation_before = pose(at - change)
        columns[:3, index] = (after - before) / (2.0 * step)
        turn = Rotation.from_matrix(rotation_after @ rotation_before.T).as_rotvec()
        columns[3:, index] = turn / (2.0 * step)
    return columns
