"""``keyhole report --robot concentric``: a tiny one is run, and its part of the page stands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robot.concentric.design import METHODS
from server.command_line import main
from server.report.tube_sections import LINKS
from server.report.tube_tasks import LABELS, QUICK_POINTS, tube_tasks
from tests.server import headless
from tests.server.report.page import Page, stands_alone

COMMAND = ["report", "--robot", "concentric", "--quick"]


def test_only_this_robot_s_sections_are_there(page: Page, folder: Path) -> None:
    sections = [attributes["id"] for tag, attributes in page.elements if tag == "section"]
    assert sections == [*(anchor for anchor, _ in LINKS), "made"]
    assert not list(folder.glob("*.npz"))
    assert len(list((folder / "tubes").glob("*.npz"))) == len(
        tube_tasks(headless.configuration(), quick=True)
    )


def test_the_page_stands_alone_and_refers_to_what_it_has(text: str, page: Page) -> None:
    stands_alone(text, page)


def test_figures_of_every_method_have_units(page: Page) -> None:
    plots = [attributes for tag, attributes in page.elements if tag == "svg"]
    assert len(plots) == 4
    assert all(attributes["aria-label"] for attributes in plots)
    words = " ".join(page.words)
    for method in METHODS:
        assert LABELS[method] in words
    for label in (
        "β, mm",
        "trajectory point",
        "‖ε_AB‖, mm",
        "peak speed of a tube, mm/s",
        "mean speed of a tube, mm/s",
        "translation of all tubes, mm",
    ):
        assert label in words


def test_a_path_that_was_cut_short_meets_no_target_of_runs(page: Page) -> None:
    words = " ".join(page.words)
    assert "no target counts as met" in words
    assert "Alsaka, Cinquin & Chikhaoui 2024" in words
    # Five things are measured, whatever is run; how fast this machine is does not matter here.
    assert words.count("✓ met") <= 5


def test_the_traces_hold_every_iteration_of_the_points_played(folder: Path) -> None:
    from server.study.folder import StudyFolder

    (file,) = (folder / "tubes").glob("lissajous_hqp_start-1_*.npz")
    trace = StudyFolder(file.parent).traces(file.stem)["trace"]
    assert trace[-1, 0] == QUICK_POINTS
    assert len(trace) > QUICK_POINTS


def test_it_says_how_long_it_took_and_takes_up_what_was_run(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.stat().st_mtime_ns for path in (folder / "tubes").glob("*.npz")}
    assert main([*COMMAND, "--out", str(folder)]) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert re.fullmatch(r"concentric tubes took \d+:\d\d\n", capsys.readouterr().err)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--robot", "hexapod"], "invalid choice: 'hexapod'"),
        (["--robot", "concentric", "--seeds", "1-3"], "--seeds does not belong here"),
        (["--robot", "concentric", "--preset", "harsh"], "--preset does not belong here"),
        (["--robot", "concentric", "--plant", "kinematic"], "--plant does not belong here"),
        (["--robot", "concentric", "--out", "/dev/null/x"], "cannot be made"),
    ],
)
def test_what_does_not_belong_together_is_refused(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", "--out", str(tmp_path), *arguments]) == 2
    assert words in capsys.readouterr().err
