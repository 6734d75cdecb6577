"""``keyhole run`` with the concentric-tube arms: the paper's figures, JSON, trace, refusals."""

from __future__ import annotations

import csv
import functools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.concentric.design import METHODS
from robot.concentric.pair import start_of
from scenes.experiments.tube_paths import tube_path
from scenes.experiments.tube_starts import random_starts
from scenes.experiments.tubes import TITLES
from server.command_line import main
from server.configuration_file import load
from server.run.tube_figures import gathered, tube_document
from server.run.tube_run import TubeRun, TubeTask, UnreachablePath, trace_columns

HEAD = "x_mm,y_mm,z_mm\n"
EVERY_KEY = (
    *("experiment", "robot", "method", "configuration", "ended", "iterations"),
    *("converged_points", "points", "bound_violation_mm", "infeasible_qps"),
    *("peak_rotation_rad_s", "peak_translation_mm_s", "translation_total_mm"),
    *("stability_min", "task_scale_min", "refused_iterations"),
)


@pytest.fixture
def short(tmp_path: Path) -> str:
    """Three points."""
    file = tmp_path / "short.csv"
    file.write_text(HEAD + "0,0,1\n0,0,2\n0,0,3\n")
    return str(file)


@functools.cache
def figures(path: str, method: str, points: int = 100) -> dict[str, Any]:
    """The gathered document of the paper's three configurations."""
    design = load(None).concentric
    documents = []
    for number, start in enumerate(design.starts, 1):
        task = TubeTask(path, str(number), start_of(start), tube_path(path)[:points])
        run = TubeRun(design, task, method)
        documents.append(tube_document(task, method, run.execute(lambda _: None, lambda: False)))
    return gathered(documents)


PAPER_S = {
    ("rectangle", "nspwln"): (490.3, 0.271, 0.310),
    ("rectangle", "nspwln-repaired"): (236.3, 0.018, 0.113),
    ("rectangle", "nspqp"): (247.7, 0.038, 0.116),
    ("rectangle", "snsqp"): (246.3, 0.037, 0.153),
    ("lissajous", "nspwln"): (498.0, 0.286, 0.291),
    ("lissajous", "nspwln-repaired"): (249.3, 0.011, 0.054),
    ("lissajous", "nspqp"): (257.0, 0.003, 0.008),
    ("lissajous", "snsqp"): (259.0, 0.017, 0.101),
}
"""Iterations, and ε_AB when a point is left: rms and largest, mm; means over the configurations."""
ITERATIONS = {
    "nspwln": (460.0, 530.0),
    "nspwln-repaired": (200.0, 270.0),
    "nspqp": (235.0, 285.0),
    "snsqp": (235.0, 285.0),
}
LARGEST = {
    "nspwln": (0.25, 0.35),
    "nspwln-repaired": (0.0, 0.15),
    "nspqp": (0.0, 0.25),
    "snsqp": (0.0, 0.25),
}


@pytest.mark.parametrize(("path", "method"), PAPER_S)
def test_the_paper_s_methods_come_out_as_the_paper_has_them(path: str, method: str) -> None:
    document = figures(path, method)
    iterations, rms, largest = PAPER_S[path, method]
    found = document["relative_error_mm"]
    assert (document["converged_points"], document["points"]) == (300, 300)
    low, high = ITERATIONS[method]
    assert low <= document["iterations"] <= high
    low, high = LARGEST[method]
    assert low <= found["max"] <= high
    assert document["iterations"] == pytest.approx(iterations, abs=3.0)
    assert found["rms"] == pytest.approx(rms, abs=0.02)
    assert found["max"] == pytest.approx(largest, abs=0.06)
    assert document["tracking_error_mm"]["max"] < 0.88


@pytest.mark.parametrize("path", ["rectangle", "lissajous"])
def test_hqp_keeps_b_beside_a_in_every_iteration(path: str) -> None:
    document = figures(path, "hqp")
    assert (document["converged_points"], document["points"]) == (300, 300)
    assert document["iterations"] <= 1.1 * figures(path, "nspqp")["iterations"]
    assert document["relative_error_mm"]["max_any_iteration"] <= 0.05
    assert document["bound_violation_mm"] <= 1e-9
    assert document["infeasible_qps"] == 0
    assert document["refused_iterations"] == {}
    assert document["peak_rotation_rad_s"] <= 0.5


def test_hqp_does_so_from_random_configurations() -> None:
    """The whole of it, 20 starts and 100 points, is ``keyhole run random --method all``."""
    design, reached = load(None).concentric, dict.fromkeys(METHODS, 0)
    for number, start in enumerate(random_starts(design, 3, 7)):
        task = TubeTask("random", str(number), start, tube_path("lissajous")[::4][:12])
        for method in METHODS:
            run = TubeRun(design, task, method)
            document = tube_document(task, method, run.execute(lambda _: None, lambda: False))
            reached[method] += document["converged_points"]
            if method == "hqp":
                assert document["relative_error_mm"]["max_any_iteration"] <= 0.2
                assert document["bound_violation_mm"] <= 1e-9
                assert document["infeasible_qps"] == 0
    assert reached["hqp"] == max(reached.values()) == 36


def test_where_nspqp_is_infeasible_snsqp_slows_down_and_finishes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = {}
    for method in ("nspqp", "snsqp", "hqp"):
        options = ["--method", method, "--configuration", "3", "--json", "-"]
        assert main(["run", "near-infeasible", *options]) == 0
        found[method] = json.loads(capsys.readouterr().out)
    assert found["nspqp"]["converged_points"] <= 2
    assert found["nspqp"]["infeasible_qps"] > 1000
    for method in ("snsqp", "hqp"):
        assert found[method]["converged_points"] == 100
        assert found[method]["infeasible_qps"] == 0
    assert found["snsqp"]["task_scale_min"] < 0.5


def test_the_json_of_one_run_holds_what_programs_rely_on(
    short: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "--robot", "concentric", "--path", short, "--json", "-"]) == 0
    output = capsys.readouterr()
    document = json.loads(output.out)
    assert output.err == ""
    assert not set(EVERY_KEY) - set(document)
    assert (document["experiment"], document["method"]) == ("short.csv", "hqp")
    assert (document["configuration"], document["points"]) == ("1", 3)
    for error in ("relative_error_mm", "tracking_error_mm"):
        found = document[error]
        assert 0.0 <= found["rms"] <= found["max"] <= found["max_any_iteration"]
        assert found["std"] >= 0.0
    assert set(document["translation_mm"]) == {"a", "b"}
    assert sum(map(sum, document["translation_mm"].values())) == pytest.approx(
        document["translation_total_mm"]
    )
    assert 0.0 < document["iteration_ms"]["median"] <= document["iteration_ms"]["p99"]


def test_all_methods_from_all_configurations_make_a_list_with_means(
    short: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--method", "all", "--configuration", "all", "--json", "-"]
    assert main(["run", "points", "--path", short, *options]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [run["method"] for run in document["runs"]] == list(METHODS)
    for run in document["runs"]:
        assert not set(EVERY_KEY) - set(run)
        own = run["configurations"]
        assert [one["configuration"] for one in own] == ["1", "2", "3"]
        assert run["iterations"] == pytest.approx(np.mean([one["iterations"] for one in own]))
        assert run["points"] == 9
        largest = [one["relative_error_mm"] for one in own]
        found = run["relative_error_mm"]
        assert found["max"] == pytest.approx(np.mean([one["max"] for one in largest]))
        assert found["max_any_iteration"] == max(one["max_any_iteration"] for one in largest)
        assert run["maxima"]["relative_error_mm"] == max(one["max"] for one in largest)


def test_random_starts_are_counted_and_seeded(capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--count", "2", "--seed", "5", "--json", "-"]
    assert main(["run", "random", *options]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["seed"], document["count"], document["points"]) == (5, 2, 200)
    assert len(document["configurations"]) == 2


def test_a_run_told_to_people_is_a_table(short: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "points", "--path", short, "--method", "all"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in told] == ["method", *METHODS]
    assert "3/3" in told[1]


def test_the_trace_has_every_inner_iteration(tmp_path: Path, short: str) -> None:
    trace, figures_file = tmp_path / "trace.csv", tmp_path / "figures.json"
    options = ["--trace", str(trace), "--json", str(figures_file), "--method", "nspqp"]
    assert main(["run", "points", "--path", short, *options]) == 0
    with open(trace, newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == trace_columns(3)
    document = json.loads(figures_file.read_text())
    assert len(rows) == document["iterations"]
    worst = max(float(row["relative_error_mm"]) for row in rows)
    assert worst == pytest.approx(document["relative_error_mm"]["max_any_iteration"])
    for row in rows:
        for tube in ("a1", "a2", "a3", "b1", "b2", "b3"):
            least, largest = float(row[f"least_{tube}_mm"]), float(row[f"largest_{tube}_mm"])
            assert least <= float(row[f"beta_{tube}_mm"]) <= largest
    assert [int(float(row["point"])) for row in rows][-1] == 3


def test_a_point_that_is_not_reached_ends_a_file_s_path(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "far.csv"
    file.write_text(HEAD + "0,0,1\n60,0,0\n0,0,1\n")
    assert main(["run", "points", "--path", str(file), "--json", "-"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["ended"] == "unreached"
    assert (document["converged_points"], document["unreached_points"]) == (1, [2])
    assert document["bound_violation_mm"] <= 1e-9


def test_points_no_tube_can_reach_are_refused_by_number() -> None:
    design = load(None).concentric
    start = start_of(design.starts[0])
    for offset, words in (
        ((0.0, 0.0, 0.2), "point 2 .* longest tube has 437.0 mm"),
        ((0.0, 0.0, -0.35), "point 2 .* behind the endoscope's face"),
    ):
        task = TubeTask("points", "1", start, np.array([(0.0, 0.0, 0.0), offset]))
        with pytest.raises(UnreachablePath, match=words) as refusal:
            TubeRun(design, task, "hqp")
        assert refusal.value.point == 2


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["run", *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert len(output.err.splitlines()) == 1
    return output.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["rectangle", "--plant", "physics"], "--plant does not belong here"),
        (["rectangle", "--case", "1"], "--case does not belong here"),
        (["rectangle", "--realtime"], "--realtime does not belong here"),
        (["rectangle", "--seed", "3"], "--seed does not belong here: it is of 'random' only"),
        (["rectangle", "--count", "3"], "--count does not belong here"),
        (["random", "--configuration", "1"], "--configuration does not belong here"),
        (["circle", "--method", "hqp"], "--method does not belong here"),
        (["circle", "--configuration", "1"], "--configuration does not belong here"),
        (["rectangle", "--configuration", "4"], "choose one of: 1, 2, 3, all"),
        (["rectangle", "--method", "dls"], "invalid choice: 'dls'"),
        (["rectangle", "--path", "p.csv"], "give either the name of an experiment or --path"),
        (["--robot", "concentric"], "give either the name of an experiment or --path"),
        (["points"], "points need --path FILE"),
        (["circle", "--robot", "concentric"], "unknown concentric-tube experiment 'circle'"),
        (["points", "--path", "/nowhere.csv"], "/nowhere.csv: No such file"),
        (["random", "--count", "0"], "a count is a whole number from 1 to 1000, not '0'"),
        (["rectangle", "--trace", "t.csv"], "--trace is of one run"),
        (["rectangle", "--json", "/nowhere/f.json"], "/nowhere/f.json cannot be written"),
    ],
)
def test_what_does_not_belong_together_is_refused_in_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in refused(arguments, capsys)


def test_a_point_file_that_is_wrong_is_refused_where_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(HEAD + "1,2,x\n")
    message = refused(["points", "--path", str(file)], capsys)
    assert f"{file}, line 2, column z_mm: 'x' is not a number" in message


def test_the_list_names_every_experiment(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--list"]) == 0
    listed = capsys.readouterr().out.split("concentric:\n")[1].splitlines()
    assert [line.split()[0] for line in listed] == list(TITLES)
