"""The concentric-tube paths: two figures, files of points, random starts."""

from __future__ import annotations

import numpy as np
import pytest

from robot.concentric.pair import ArmPair, PairKinematics
from robot.concentric.proximal import Proximal
from robot.errors import UnknownName
from scenes.csv_table import TableError
from scenes.experiments.tube_paths import (
    NAMES,
    POINTS_MAX,
    lissajous,
    parse_points,
    rectangle,
    tube_path,
)
from scenes.experiments.tube_starts import STABILITY_MIN, random_starts
from scenes.experiments.tubes import TITLES, motions, starts
from server.configuration_file import load

HEAD = "x_mm,y_mm,z_mm\n"


def test_the_rectangle_goes_around_30_by_20_mm() -> None:
    points = 1e3 * rectangle()
    corners = {(-30.0, 0.0), (-30.0, 20.0), (0.0, 20.0), (0.0, 0.0)}
    assert corners <= {(round(x, 9), round(y, 9)) for x, y, _ in points}
    assert np.all(points[:, 2] == 0.0)
    np.testing.assert_allclose(points[0], [-1.0, 0.0, 0.0])
    np.testing.assert_allclose(points[-1], 0.0, atol=1e-12)


def test_the_lissajous_figure_is_the_reference_s() -> None:
    points = 1e3 * lissajous()
    expected = {
        0: (1.071339, 0.021598),
        5: (6.344453, 0.877009),
        9: (9.754977, 3.284579),
        11: (9.842794, 5.375530),
        93: (-6.344453, 0.877009),
        99: (0.0, 0.0),
    }
    for place, (x, z) in expected.items():
        np.testing.assert_allclose(points[place], [x, 0.0, z], rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.ptp(points, axis=0), [20.0, 0.0, 30.0], atol=0.1)


@pytest.mark.parametrize("name", NAMES)
def test_both_figures_have_100_points_a_millimetre_apart(name: str) -> None:
    points = 1e3 * tube_path(name)
    assert points.shape == (100, 3)
    steps = np.linalg.norm(np.diff(points, axis=0, prepend=np.zeros((1, 3))), axis=1)
    assert np.all(steps > 0.98)
    assert np.all(steps < 1.08)


def test_an_unknown_path_is_refused_with_those_that_exist() -> None:
    with pytest.raises(UnknownName, match="rectangle, lissajous"):
        tube_path("star")
    with pytest.raises(UnknownName, match="near-infeasible"):
        motions("star")


def test_points_are_read_in_millimetres() -> None:
    points = parse_points("# by hand\n" + HEAD + "1, 2,3\n\n-4.5,0,1e-3\n", "a.csv")
    np.testing.assert_allclose(points, 1e-3 * np.array([[1, 2, 3], [-4.5, 0, 1e-3]]))


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("x,y,z\n1,2,3\n", 1, "", "the columns must be x_mm, y_mm, z_mm"),
        (HEAD + "1,2\n", 2, "", "2 values where 3 are needed"),
        (HEAD + "1,2,3\n1,two,3\n", 3, "y_mm", "'two' is not a number"),
        (HEAD + "1,2,nan\n", 2, "z_mm", "nan is not a finite number"),
        (HEAD + "inf,2,3\n", 2, "x_mm", "inf is not a finite number"),
        (HEAD + "1,2,3000\n", 2, "z_mm", "3000 mm is out of range (±1000 mm)"),
        (HEAD, 1, "", "0 rows where 1 or more are needed"),
        ("", 1, "", "0 rows where 1"),
        (HEAD + "1,2,3\n" * (POINTS_MAX + 1), POINTS_MAX + 2, "", "cut the file in two"),
    ],
)
def test_a_file_that_is_wrong_is_refused_where_it_is(
    text: str, line: int, column: str, words: str
) -> None:
    with pytest.raises(TableError) as refusal:
        parse_points(text, "points.csv")
    error = refusal.value
    assert (error.file, error.line, error.column) == ("points.csv", line, column)
    assert words in str(error)
    assert f"points.csv, line {line}" in str(error)


def test_random_starts_are_stable_inside_the_limits_and_the_same_for_a_seed() -> None:
    design = load(None).concentric
    found = random_starts(design, 5, 3)
    np.testing.assert_array_equal(found, random_starts(design, 5, 3))
    assert np.abs(found - random_starts(design, 5, 4)).max() > 0.01
    pair, limits = ArmPair(design), Proximal(design)
    kinematics = PairKinematics(pair.count)
    for q in found:
        kinematics.q[:] = q
        assert pair.evaluate_cold(kinematics) == 0
        assert kinematics.stability.min() >= STABILITY_MIN
        assert limits.excess(q[:3]) == limits.excess(q[6:9]) == 0.0


def test_every_experiment_has_motions_and_starts() -> None:
    design = load(None).concentric
    for name in TITLES:
        if name != "points":
            assert all(len(motion.offsets) >= 100 for motion in motions(name))
            assert len(starts(name, design, 2, 1)) == (2 if name == "random" else 3)
