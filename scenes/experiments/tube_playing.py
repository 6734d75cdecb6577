"""The paths of arm A's tip as the console plays them: at a speed that tubes can follow."""

from __future__ import annotations

import numpy as np

from robot.errors import UnknownName
from scenes.experiments.timing import cruise, still, times
from scenes.experiments.tube_paths import NAMES, tube_path
from scenes.path import Path

SPEED_M_S = 2e-3
"""Even speed along the path: tubes translate by 5 mm/s at most."""
_RAMP_S = 2.0

TITLES = {
    "rectangle": "rectangle of 30 by 20 mm, B beside A, 52 s",
    "lissajous": "figure of eight of 30 by 20 mm, B beside A, 56 s",
}


def played(name: str) -> Path:
    """The path called ``name`` from rest to rest; raises :class:`robot.errors.UnknownName`."""
    if name not in NAMES:
        raise UnknownName("experiment", name, NAMES)
    return over_time(tube_path(name), name)


def over_time(offsets: np.ndarray, name: str) -> Path:
    """A path through ``offsets`` (n, 3), m from where it starts, at an even speed."""
    points = np.concatenate([np.zeros((1, 3)), offsets])
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(chords)])
    duration_s = along[-1] / SPEED_M_S + _RAMP_S
    samples = still(times(duration_s))
    done = along[-1] * cruise(samples[:, 0] / duration_s, _RAMP_S / duration_s)
    for axis in range(3):
        samples[:, 1 + axis] = np.interp(done, along, points[:, axis])
    return Path(samples, name)
