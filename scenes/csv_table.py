"""Tables of numbers from CSV, with the place of whatever is wrong in them."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from typing import NamedTuple

from robot.errors import KeyholeError


class TableError(KeyholeError):
    """A file of rows cannot be used.

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


class Row(NamedTuple):
    """One row: its line in the file, from 1, and its numbers."""

    line: int
    values: list[float]


def read_rows(text: str, name: str, header: tuple[str, ...], least: int, most: int) -> list[Row]:
    """Every row of a table. Empty lines and those that begin with # are passed over.

    Args:
        text: contents of the file; the first line holds the column names.
        name: name of the file, for messages.
        header: the column names.
        least: how many rows there must be.
        most: how many there may be.

    Raises:
        TableError: names file, line and column of the first thing that is wrong.
    """
    reader = csv.reader(io.StringIO(text.removeprefix("\ufeff")), skipinitialspace=True)
    rows: list[Row] = []
    try:
        for line, fields in _lines(reader, name, header):
            if len(rows) == most:
                raise TableError(name, line, "", f"more than {most} rows; cut the file in two")
            values = [
                _number(name, line, column, field)
                for column, field in zip(header, fields, strict=True)
            ]
            rows.append(Row(line, values))
    except csv.Error as error:
        raise TableError(name, reader.line_num, "", str(error)) from None
    if len(rows) < least:
        detail = f"{len(rows)} rows where {least} or more are needed"
        raise TableError(name, max(reader.line_num, 1), "", detail)
    return rows


def check_range(name: str, line: int, column: str, value_mm: float, most_mm: float) -> None:
    """Raise :class:`TableError` for a length beyond ``most_mm`` either way."""
    if abs(value_mm) > most_mm:
        detail = f"{value_mm:g} mm is out of range (±{most_mm:g} mm)"
        raise TableError(name, line, column, detail)


def _lines(
    reader: Iterator[list[str]], name: str, header: tuple[str, ...]
) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each row below the column names."""
    seen = False
    for fields in reader:
        line: int = reader.line_num  # type: ignore[attr-defined] # of a csv.reader
        if not fields or fields[0].lstrip().startswith("#"):
            continue
        if not seen:
            seen = True
            if tuple(field.strip() for field in fields) != header:
                raise TableError(name, line, "", f"the columns must be {', '.join(header)}")
            continue
        if len(fields) != len(header):
            detail = f"{len(fields)} values where {len(header)} are needed"
            raise TableError(name, line, "", detail)
        yield line, fields


def _number(file: str, line: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise TableError(file, line, column, f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise TableError(file, line, column, f"{text.strip()} is not a finite number")
    return value
