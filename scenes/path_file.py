"""Paths from CSV: ``time_s, x_mm, y_mm, z_mm, qw, qx, qy, qz``, from t = 0."""

from __future__ import annotations

import math

import numpy as np

from scenes.csv_table import Row, TableError, check_range, read_rows
from scenes.path import Path

HEADER = ("time_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
ROWS_MAX = 200_000
TRANSLATION_MAX_MM = 2000.0


def parse_csv(text: str, name: str) -> Path:
    """Read a path.

    Args:
        text: contents of the file; the first line holds the column names.
        name: name of the file, for messages.

    Raises:
        TableError: names file, line and column of the first thing that is wrong.
    """
    rows = read_rows(text, name, HEADER, 2, ROWS_MAX)
    last_time: float | None = None
    for row in rows:
        _check_row(name, row, last_time)
        last_time = row.values[0]
    samples = np.array([row.values for row in rows])
    samples[:, 1:4] *= 1e-3
    return Path(samples, name)


def _check_row(file: str, row: Row, last_time: float | None) -> None:
    line, values = row
    if last_time is None and values[0] != 0.0:
        raise TableError(file, line, "time_s", f"the path must start at 0, not at {values[0]:g}")
    if last_time is not None and values[0] <= last_time:
        raise TableError(
            file, line, "time_s", f"time must increase: {values[0]:g} follows {last_time:g}"
        )
    for column, value in zip(HEADER[1:4], values[1:4], strict=True):
        check_range(file, line, column, value, TRANSLATION_MAX_MM)
    if math.hypot(*values[4:8]) < 1e-3:
        raise TableError(file, line, "qw", "the quaternion is zero")
