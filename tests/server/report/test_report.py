"""``keyhole report``: a tiny one is built, and the page stands alone."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from server.command_line import main
from server.report.results import SETTINGS, Results, tasks
from server.report.targets import TARGETS
from server.report.tube_results import TubeResults
from server.report.tube_tasks import TubeWork
from server.study.folder import StudyFolder
from server.study.study import StudyResult
from server.study.task import Task
from tests.server import headless
from tests.server.report.page import Page

COMMAND = ["report", "--robot", "instrument", "--plant", "kinematic", "--quick"]


def test_the_page_refers_to_nothing_outside_itself(text: str, page: Page) -> None:
    assert "http" not in text
    assert "@import" not in text
    assert not re.findall(r"url\((?!#)", text)
    for tag, attributes in page.elements:
        assert tag not in {"script", "link", "img", "iframe", "object"}
        for name in ("src", "href", "xlink:href", "srcset", "data"):
            assert (attributes.get(name) or "#").startswith("#"), (tag, attributes)


def test_ids_are_unique_and_everything_referred_to_exists(text: str, page: Page) -> None:
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    referred = set(re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', text))
    assert {one or other for one, other in referred} <= set(ids)


def test_the_targets_come_first_and_a_cut_path_meets_none(page: Page) -> None:
    sections = [attributes["id"] for tag, attributes in page.elements if tag == "section"]
    assert sections[0] == "targets"
    assert sections[-1] == "made"
    words = " ".join(page.words)
    assert words.count("✓ met") == 1  # the speed
    assert "no target counts as met" in words
    for target in TARGETS:
        assert f"run {target.setting.words()}" in words


def test_every_experiment_has_its_plots(page: Page, text: str) -> None:
    sections = {attributes["id"] for tag, attributes in page.elements if tag == "section"}
    assert {f"experiment-{one.experiment}" for one in SETTINGS} <= sections
    assert {"fit", "claims", "twists", "dexterity"} <= sections
    plots = [attributes for tag, attributes in page.elements if tag == "svg"]
    assert len(plots) >= 2 * len({one.experiment for one in SETTINGS}) + 2
    assert all(attributes["aria-label"] and attributes["viewbox"] for attributes in plots)
    assert not re.search(r"#0101\d\d", text)
    assert "var(--desired)" in text
    assert "var(--true)" in text


def test_light_dark_and_print_are_provided_for(text: str) -> None:
    assert "color-scheme: light dark" in text
    assert "@media print" in text
    used = set(re.findall(r"var\((--[\w-]+)\)", text))
    assert used <= set(re.findall(r"(--[\w-]+):", text))


def test_a_second_report_takes_up_what_the_first_has_run(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    assert len(before) == len(SETTINGS)
    assert main([*COMMAND, "--out", str(folder)]) == 0
    assert {path: path.stat().st_mtime_ns for path in folder.glob("*.npz")} == before
    assert "of" not in capsys.readouterr().err


def test_a_missing_run_leaves_a_gap_and_no_verdict(folder: Path) -> None:
    from server.report.page import Conditions, page

    configuration = headless.configuration()
    study: StudyResult[Task] = StudyResult({})
    conditions = Conditions("physics", "paper", [1], None, None, "0", "mark", "again", ["<all>"])
    text = page(Results(study, StudyFolder(folder)), configuration, conditions)
    words = " ".join(Page(text).words)
    assert "0 of " in words
    assert "met" in words
    assert "✓" not in words
    assert "&lt;all&gt;" in text


def test_both_robots_stand_on_one_page(folder: Path) -> None:
    from server.report.page import Conditions, page

    instrument: StudyResult[Task] = StudyResult({})
    tubes: StudyResult[TubeWork] = StudyResult({})
    own = StudyFolder(folder)
    conditions = Conditions("physics", "paper", [1], None, None, "0", "mark", "again")
    results, others = Results(instrument, own), TubeResults(tubes, own)
    found = Page(page(results, headless.configuration(), conditions, others))
    ids = [attributes["id"] for tag, attributes in found.elements if tag == "section"]
    assert ids[0] == "targets"
    assert ids.index("claims") < ids.index("tubes-targets")
    assert ids[-1] == "made"


def test_every_setting_is_run_with_every_seed() -> None:
    found = tasks("physics", "paper", [1, 2], None)
    assert len(found) == len(set(found)) == 2 * len(SETTINGS)
    assert {target.setting for target in TARGETS} <= set(SETTINGS)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "required: --out"),
        (["--out", "x", "--preset", "shiny"], "invalid choice: 'shiny'"),
        (["--out", "x", "--seeds", "3-1"], "is no range"),
        (["--out", "/dev/null/x"], "cannot be made"),
    ],
)
def test_what_cannot_be_reported_is_refused(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", *arguments]) == 2
    assert words in capsys.readouterr().err
