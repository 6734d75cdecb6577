"""The paths of arm A's tip: a rectangle, a Lissajous figure, and files of points.

The paper prints neither; both figures have 100 points of about 1 mm and start and end at the tip.
"""

from __future__ import annotations

import math

import numpy as np

from robot.errors import UnknownName
from scenes.csv_table import check_range, read_rows

HEADER = ("x_mm", "y_mm", "z_mm")
POINTS_MAX = 20_000
OFFSET_MAX_MM = 1000.0
NAMES = ("rectangle", "lissajous")

_POINTS = 100
_CHORDS = 4000


def tube_path(name: str) -> np.ndarray:
    """Offsets (100, 3), m, of the path called ``name``; raises ``UnknownName``."""
    if name == "rectangle":
        return rectangle()
    if name == "lissajous":
        return lissajous()
    raise UnknownName("path", name, NAMES)


def rectangle() -> np.ndarray:
    """30 × 20 mm toward −x and +y: offsets (100, 3) from the first tip position, m, 1 mm apart."""
    along = np.arange(1, _POINTS + 1) * (100.0 / _POINTS)
    x = -np.interp(along, [0.0, 30.0, 50.0, 80.0, 100.0], [0.0, 30.0, 30.0, 0.0, 0.0])
    y = np.interp(along, [0.0, 30.0, 50.0, 80.0, 100.0], [0.0, 0.0, 20.0, 20.0, 0.0])
    return 1e-3 * np.column_stack([x, y, np.zeros(_POINTS)])


def lissajous() -> np.ndarray:
    """An eight 30 mm along +z and 20 mm along x: offsets (100, 3), m, even along its 107 mm.

    x = 10 sin 2φ, z = 15 (1 − cos φ) in mm; its length is that of 4000 chords.
    """
    phase = np.linspace(0.0, 2.0 * math.pi, _CHORDS + 1)
    x, z = 10.0 * np.sin(2.0 * phase), 15.0 * (1.0 - np.cos(phase))
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(z)))])
    chosen = np.interp(np.arange(1, _POINTS + 1) * along[-1] / _POINTS, along, phase)
    x, z = 10.0 * np.sin(2.0 * chosen), 15.0 * (1.0 - np.cos(chosen))
    return 1e-3 * np.column_stack([x, np.zeros(_POINTS), z])


def parse_points(text: str, name: str) -> np.ndarray:
    """Read offsets from A's first tip position, one point a row.

    Args:
        text: contents of the file; the first line holds the column names ``x_mm,y_mm,z_mm``.
        name: name of the file, for messages.

    Returns:
        Offsets (points, 3), m.

    Raises:
        TableError: names file, line and column of the first thing that is wrong.
    """
    rows = read_rows(text, name, HEADER, 1, POINTS_MAX)
    for line, values in rows:
        for column, value in zip(HEADER, values, strict=True):
            check_range(name, line, column, value, OFFSET_MAX_MM)
    return 1e-3 * np.array([row.values for row in rows])
