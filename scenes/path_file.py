"""Paths from CSV: ``time_s, x_mm, y_mm, z_mm, qw, qx, qy, qz``, from t = 0."""

from __future__ import annotations

import csv
import io
import math

import numpy as np

from robot.errors import KeyholeError
from scenes.path import Path

HEADER = ("time_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
ROWS_MAX = 200_000
TRANSLATION_MAX_MM = 2000.0


class PathFileError(KeyholeError):
    """A path file cannot be used.

    Attributes:
        file: its name.
        line: line in the file, from 1.
        column: name of the column, or empty.
    """

    code = "path_file"

    def __init__(self, file: str, line: int, column: str, detail: str) -> None:
        place = f"{file}, line {line}" + (f", column {column}" if column else "")
        super().__init__(f"{place}: {detail}")
        self.file, self.line, self.column = file, line, column


def _number(file: str, line: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise PathFileError(file, line, column, f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise PathFileError(file, line, column, f"{text.strip()} is not a finite number")
    return value


def _check_row(file: str, line: int, row: list[float], last_time: float | None) -> None:
    if last_time is None and row[0] != 0.0:
        raise PathFileError(file, line, "time_s", f"the path must start at 0, not at {row[0]:g}")
    if last_time is not None and row[0] <= last_time:
        raise PathFileError(
            file, line, "time_s", f"time must increase: {row[0]:g} follows {last_time:g}"
        )
    for column, value in zip(HEADER[1:4], row[1:4], strict=True):
        if abs(value) > TRANSLATION_MAX_MM:
            raise PathFileError(
                file, line, column, f"{value:g} mm is out of range (±{TRANSLATION_MAX_MM:g} mm)"
            )
    if math.hypot(*row[4:8]) < 1e-3:
        raise PathFileError(file, line, "qw", "the quaternion is zero")


def parse_csv(text: str, name: str) -> Path:
    """Read a path.

    Args:
        text: contents of the file; the first line holds the column names.
        name: name of the file, for messages.

    Raises:
        PathFileError: names file, line and column of the first thing that is wrong.
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
                    raise PathFileError(name, line, "", f"the columns must be {', '.join(HEADER)}")
                continue
            if len(fields) != len(HEADER):
                raise PathFileError(
                    name, line, "", f"{len(fields)} values where {len(HEADER)} are needed"
                )
            row = [
                _number(name, line, column, field)
                for column, field in zip(HEADER, fields, strict=True)
            ]
            _check_row(name, line, row, rows[-1][0] if rows else None)
            rows.append(row)
            if len(rows) > ROWS_MAX:
                raise PathFileError(name, line, "", f"more than {ROWS_MAX} rows")
    except csv.Error as error:
        raise PathFileError(name, reader.line_num, "", str(error)) from None
    if len(rows) < 2:
        raise PathFileError(name, max(reader.line_num, 1), "", "a path needs two rows or more")
    samples = np.array(rows)
    samples[:, 1:4] *= 1e-3
    return Path(samples, name)
