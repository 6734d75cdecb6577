"""What a headless run is asked: options over the configuration, figures of the bend, the table."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robot.errors import UnknownName
from scenes.experiments import experiment, names
from server.commands.progress_bar import bar, clock
from server.run.figure_table import COLUMNS, csv_text, figure, printed
from server.run.figures import bend_errors
from server.run.headless import HeadlessRun
from server.run.options import RunOptions, cut, options_for
from tests.server import headless

PATH = headless.path([[0, 0, 0, 0], [0.2, 0.001, 0, 0], [0.5, 0, 0, 0]], "short")


def test_options_replace_what_they_name_and_leave_the_rest() -> None:
    configuration = headless.configuration()
    options = RunOptions("x", PATH, "2", "hqp", "uv", preset="harsh", seed=7, tracker=True)
    options = replace(options, actuation="tension-unit")
    applied = options.applied(configuration)
    assert applied.simulation.preset == "harsh"
    assert applied.simulation.seed == 7
    assert applied.simulation.actuation == "tension-unit"
    assert applied.tracker.enabled
    assert applied.priority.case == "2"
    assert applied.simulation.plant == configuration.simulation.plant
    assert applied.simulation.board == configuration.simulation.board
    assert applied.compensation == configuration.compensation
    assert applied.hash64() != configuration.hash64()
    assert configuration == headless.configuration()


@pytest.mark.parametrize("name", names())
def test_an_experiment_brings_its_board_and_locks_its_arm(name: str) -> None:
    configuration = headless.configuration()
    found = experiment(name, configuration)
    options = options_for(found, configuration, found.cases[0])
    assert options.applied(configuration).simulation.board == found.board
    assert options.lock_arm == found.lock_arm == name.startswith("arc")
    assert options.path is found.path


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"case": "3"}, "priority case '3'"),
        ({"preset": "shiny"}, "preset 'shiny'"),
        ({"plant": "steam"}, "plant 'steam'"),
        ({"actuation": "steam"}, "actuation 'steam'"),
        ({"compensation": "half"}, "compensation 'half'"),
    ],
)
def test_unknown_names_are_refused_with_those_that_exist(
    fields: dict[str, str], words: str
) -> None:
    wanted: dict[str, Any] = {"case": "1"} | fields
    options = RunOptions("x", PATH, solver="hqp", coordinates="uv", **wanted)
    with pytest.raises(UnknownName, match=f"unknown {words}; choose one of"):
        HeadlessRun(headless.configuration(), options)


def test_a_path_is_cut_without_a_change_before_the_cut() -> None:
    path = experiment("circle", headless.configuration()).path
    part = cut(path, 2.0)
    assert part.duration_s == pytest.approx(2.0)
    assert cut(path, None) is path
    assert cut(path, 1e6) is path
    assert cut(path, 1e-9).duration_s > 0.0
    one, other = np.empty(7), np.empty(7)
    for time_s in np.linspace(0.0, 1.8, 19):
        path.at(float(time_s), one)
        part.at(float(time_s), other)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


def test_a_run_paced_by_the_clock_takes_as_long_as_its_path() -> None:
    options = RunOptions("x", PATH, "1", "hqp", "uv", plant="kinematic", realtime=True)
    result = HeadlessRun(headless.configuration(), options).execute(lambda _: None, lambda: False)
    assert result.ended == "completed"
    assert 0.0 < result.realtime_factor <= 1.01


def bends(size: float, direction: float) -> np.ndarray:
    return np.array([[size * math.cos(direction), size * math.sin(direction)]])


def test_the_bend_s_error_has_its_sign_through_the_straight_segment() -> None:
    turning = np.array([False])
    for wanted in (0.3, 0.01, -0.01, -0.3):
        for off in (0.02, -0.02):
            desired, true = bends(wanted, 0.4), bends(wanted - off, 0.4)
            found, direction = bend_errors(true, desired, turning)
            assert abs(found[0]) == pytest.approx(abs(off), abs=1e-12)
            assert direction[0] == 0.0


def test_the_direction_s_error_is_desired_minus_true_and_never_more_than_half_a_turn() -> None:
    turning = np.array([True])
    for wanted in np.linspace(-3.0, 3.0, 13):
        for off in (0.1, -0.1, 3.0):
            found, direction = bend_errors(bends(0.5, wanted - off), bends(0.6, wanted), turning)
            assert direction[0] == pytest.approx(off, abs=1e-12)
            assert found[0] == pytest.approx(0.1, abs=1e-12)


def test_the_table_holds_every_figure_and_leaves_out_what_there_is_not() -> None:
    document = headless.play(PATH).document
    rows = list(csv.DictReader(io.StringIO(csv_text([document, document]))))
    assert [list(row) for row in rows] == [[name for name, _ in COLUMNS]] * 2
    for name, place in COLUMNS:
        value = figure(document, place)
        assert rows[0][name] == ("" if value is None else str(value))
    assert rows[0]["bend_max_deg"] == ""
    table = printed([document])
    assert document["experiment"] in table
    assert document["ended"] in table


def test_the_bar_says_what_is_left() -> None:
    assert bar("circle", 0.5, 30.0) == f"circle [{'#' * 15}{'.' * 15}]  50 %, 0:30 left"
    assert bar("circle", 0.0, 0.0).endswith("-:-- left")
    assert [clock(seconds) for seconds in (0.4, 65, 3600, 3725)] == [
        "0:00",
        "1:05",
        "1:00:00",
        "1:02:05",
    ]
