"""The paths of arm A's tip: a rectangle, a Lissajous figure, and files of points.

The paper prints neither; both figures have 100 points of about 1 mm and start and end at the tip.
"""

from __future__ import annotations

import csv
import io
import math

import numpy as np

from robot.errors import KeyholeError, UnknownName

HEADER = ("x_mm", "y_mm", "z_mm")
POINTS_MAX = 20_000
OFFSET_MAX_MM = 1000.0
NAMES = ("rectangle", "lissajous")

_POINTS = 100
_CHORDS = 4000


class PointFileError(KeyholeError):
    """A file of points cannot be used.

    Attributes:
        file: its name.
        line: line in the file, from 1.
        column: name of the column, or empty.
    """

    code = "point_file"

    def __init__(self, file: str, line: int, column: str, detail: str) -> None:
        place = f"{file}, line {line}" + (f", column {column}" if column else "")
        super().__init__(f"{place}: {detail}")
        self.file, self.line, self.column = file, line, column


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


def _offset(file: str, line: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise PointFileError(
            file, line, column, f"{text.strip()!r} is not a number; write an offset in mm"
        ) from None
    if not abs(value) <= OFFSET_MAX_MM:
        raise PointFileError(
            file, line, column, f"{text.strip()} mm is out of range (±{OFFSET_MAX_MM:g} mm)"
        )
    return value


def parse_points(text: str, name: str) -> np.ndarray:
    """Read offsets from A's first tip position, one point a row.

    Args:
        text: contents of the file; the first line holds the column names ``x_mm,y_mm,z_mm``.
        name: name of the file, for messages.

    Returns:
        Offsets (points, 3), m.

    Raises:
        PointFileError: names file, line and column of the first thing that is wrong.
    """
    reader = csv.reader(io.StringIO(text.removeprefix("\ufeff")), skipinitialspace=True)
    rows: list[list[float]] = []
    header: tuple[str, ...] | None = None
    try:
        for fields in reader:
            line = reader.line_num
            if not fields or fields[0].lstrip().startswith("#"):
                continue
            if header is None:
                header = tuple(field.strip() for field in fields)
                if header != HEADER:
                    raise PointFileError(name, line, "", f"the columns must be {', '.join(HEADER)}")
                continue
            if len(fields) != len(HEADER):
                raise PointFileError(
                    name, line, "", f"{len(fields)} values where {len(HEADER)} are needed"
                )
            if len(rows) == POINTS_MAX:
                raise PointFileError(
                    name, line, "", f"more than {POINTS_MAX} points; cut the path in two"
                )
            rows.append(
                [
                    _offset(name, line, column, field)
                    for column, field in zip(HEADER, fields, strict=True)
                ]
            )
    except csv.Error as error:
        raise PointFileError(name, reader.line_num, "", str(error)) from None
    if not rows:
        raise PointFileError(
            name, max(reader.line_num, 1), "", "holds no point; write one offset a row"
        )
    return 1e-3 * np.array(rows)
