"""Path files: whatever is wrong is named by file, line and column."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.csv_table import TableError
from scenes.path_file import HEADER, ROWS_MAX, parse_csv

HEAD = "time_s, x_mm, y_mm, z_mm, qw, qx, qy, qz\n"
GOOD = "0,0,0,0,1,0,0,0\n"


def refused(text: str) -> TableError:
    with pytest.raises(TableError) as caught:
        parse_csv(text, "paths/mine.csv")
    error = caught.value
    assert error.file == "paths/mine.csv"
    assert str(error).startswith(f"paths/mine.csv, line {error.line}")
    assert not error.column or f", column {error.column}: " in str(error)
    assert "\n" not in str(error)
    return error


def test_a_good_file_is_read_in_metres() -> None:
    path = parse_csv(HEAD + GOOD + "0.5,10,-20,30,0,1,0,0\n2,1,2,3,2,0,0,0\n", "good.csv")
    assert path.name == "good.csv"
    assert path.duration_s == 2.0
    np.testing.assert_allclose(path.samples[1, :4], [0.5, 0.010, -0.020, 0.030], atol=1e-18)
    np.testing.assert_allclose(path.samples[2, 4:], [1, 0, 0, 0], atol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        HEAD.replace(" ", "") + GOOD + "1,0,0,0,1,0,0,0",
        "\ufeff" + HEAD + GOOD + "1,0,0,0,1,0,0,0\n",
        "# recorded in the lab\n" + HEAD + "\n" + GOOD + "# half-way\n\n1,0,0,0,1,0,0,0\n",
        (HEAD + GOOD + "1,0,0,0,1,0,0,0\n").replace("\n", "\r\n"),
        HEAD + " 0 , 0 ,0,0,1,0,0, 0\n1e0,0,0,0,1,0,0,0\n",
    ],
    ids=["no spaces", "byte order mark", "comments and blank lines", "CRLF", "spaces"],
)
def test_files_as_people_write_them_are_read(text: str) -> None:
    assert parse_csv(text, "good.csv").duration_s == 1.0


@pytest.mark.parametrize("column", range(8))
@pytest.mark.parametrize("value", ["", "abc", "1,5e", "0x10", "nan", "NaN", "inf", "-inf", "1e999"])
def test_a_value_that_is_no_finite_number_is_named(column: int, value: str) -> None:
    if "," in value:
        value = f'"{value}"'
    cells = ["1", "0", "0", "0", "1", "0", "0", "0"]
    cells[column] = value
    error = refused(HEAD + GOOD + ",".join(cells) + "\n")
    assert (error.line, error.column) == (3, HEADER[column])


@pytest.mark.parametrize("cells", [1, 7, 9])
def test_too_few_or_too_many_values_are_counted(cells: int) -> None:
    error = refused(HEAD + GOOD + ",".join(["1"] * cells) + "\n")
    assert (error.line, error.column) == (3, "")
    assert f"{cells} values where 8 are needed" in str(error)


@pytest.mark.parametrize(
    "head",
    [
        "time_s,x_mm,y_mm,z_mm,qw,qx,qy\n",
        "time_s,x_m,y_m,z_m,qw,qx,qy,qz\n",
        "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n",
        "time_s;x_mm;y_mm;z_mm;qw;qx;qy;qz\n",
        GOOD,
    ],
)
def test_wrong_columns_are_told_the_right_ones(head: str) -> None:
    error = refused(head + GOOD + "1,0,0,0,1,0,0,0\n")
    assert error.line == 1
    assert ", ".join(HEADER) in str(error)


@pytest.mark.parametrize("time", ["1", "0.9", "-5"])
def test_time_must_increase(time: str) -> None:
    error = refused(f"{HEAD}{GOOD}1,0,0,0,1,0,0,0\n{time},0,0,0,1,0,0,0\n")
    assert (error.line, error.column) == (4, "time_s")


@pytest.mark.parametrize("time", ["0.1", "-1"])
def test_time_must_start_at_zero(time: str) -> None:
    error = refused(f"{HEAD}{time},0,0,0,1,0,0,0\n5,0,0,0,1,0,0,0\n")
    assert (error.line, error.column) == (2, "time_s")


@pytest.mark.parametrize(("place", "column"), [(1, "x_mm"), (2, "y_mm"), (3, "z_mm")])
@pytest.mark.parametrize("value", ["2000.1", "-2001", "1e300"])
def test_a_translation_out_of_range_is_named(place: int, column: str, value: str) -> None:
    cells = ["1", "0", "0", "0", "1", "0", "0", "0"]
    cells[place] = value
    error = refused(HEAD + GOOD + ",".join(cells))
    assert (error.line, error.column) == (3, column)


@pytest.mark.parametrize("quaternion", ["0,0,0,0", "1e-9,0,0,0"])
def test_a_zero_quaternion_is_named(quaternion: str) -> None:
    error = refused(f"{HEAD}{GOOD}1,0,0,0,{quaternion}\n")
    assert (error.line, error.column) == (3, "qw")


@pytest.mark.parametrize("text", ["", "\n", HEAD, HEAD + GOOD, "# nothing\n"])
def test_less_than_two_rows_are_no_path(text: str) -> None:
    assert "rows where 2 or more are needed" in str(refused(text))


def test_lines_are_counted_as_an_editor_does() -> None:
    error = refused(f"# a\n\n{HEAD}# b\n{GOOD}\n1,0,0,zero,1,0,0,0\n")
    assert (error.line, error.column) == (7, "z_mm")


def test_more_rows_than_allowed_are_refused() -> None:
    rows = "".join(f"{index},0,0,0,1,0,0,0\n" for index in range(ROWS_MAX + 1))
    assert refused(HEAD + rows).line == ROWS_MAX + 2


def test_what_is_no_csv_at_all_is_refused() -> None:
    assert refused(HEAD + GOOD + '"' + "x" * 200_000 + "\n").line == 3
    refused("\x00\x01\x02")
