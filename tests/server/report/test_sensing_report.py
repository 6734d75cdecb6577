"""``keyhole report --robot sensing``: a tiny one is run, its part of the page stands; each rule."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenes.experiments.sensing import CHIRP, COVERAGE, FORCE_LEVELS, PULL_RELEASE, SHAPE_FREE
from server.command_line import main
from server.report.sensing_results import SensingResults
from server.report.sensing_sections import LINKS
from server.report.sensing_targets import SensingVerdict, sensing_verdicts
from server.report.sensing_tasks import NOISES, NOISY, QUIET, SEEDS, SensingWork, sensing_tasks
from server.report.sensing_words import free_words
from server.run.sensing_coverage import CoverageResult
from server.run.sensing_options import FRICTION, TENSION_NOISE_N, TRIALS
from server.run.sensing_traces import coverage_arrays, packed
from server.study.folder import StudyFolder
from server.study.study import StudyResult
from tests.server import headless
from tests.server.report.page import Page, stands_alone

COMMAND = ["report", "--robot", "sensing", "--quick"]


def test_only_its_own_sections_are_there(page: Page, folder: Path) -> None:
    sections = [attributes["id"] for tag, attributes in page.elements if tag == "section"]
    assert sections == [*(anchor for anchor, _ in LINKS), "made"]
    assert not list(folder.glob("*.npz"))
    assert len(list((folder / "sensing").glob("*.npz"))) == len(sensing_tasks(quick=True))
    assert (folder / "sensing" / "table.csv").read_text().startswith("experiment,seed,friction")


def test_the_page_stands_alone_and_refers_to_what_it_has(text: str, page: Page) -> None:
    stands_alone(text, page)


def test_the_paper_s_figures_are_there_with_units(page: Page) -> None:
    words = " ".join(page.words)
    for number in ("Fig. 6", "Fig. 7", "Fig. 9", "Fig. 10", "Fig. 11", "Fig. 12"):
        assert number in words
    for label in (
        "angle, mrad",
        "torque, mN m",
        "position error, rms, mm",
        "angle error, rms, °",
        "toward the bend, mm",
        "tension of the pulled tendon, N",
        "force on the platform, N",
        "estimated − true, mN",
    ):
        assert label in words
    plots = [attributes for tag, attributes in page.elements if tag == "svg"]
    assert len(plots) == 1 + 1 + 4 + 2 + 2
    assert all(attributes["aria-label"] for attributes in plots)


def test_a_few_samples_meet_no_target_and_free_bending_is_told_plainly(page: Page) -> None:
    words = " ".join(page.words)
    assert "no target counts as met" in words
    assert "✓ met" not in words
    assert re.search(r"Without friction constant curvature (wins|is as good)", words)
    assert "With friction (μ = 0.15) constant curvature loses" in words
    assert "eq. (43)" in words


def test_it_takes_up_what_was_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {path: path.stat().st_mtime_ns for path in (folder / "sensing").glob("*.npz")}
    assert main([*COMMAND, "--out", str(folder)]) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert re.fullmatch(r"shape and force sensing took \d+:\d\d\n", capsys.readouterr().err)


@pytest.mark.parametrize("option", ["--seeds 1-3", "--preset harsh", "--plant kinematic"])
def test_what_does_not_belong_together_is_refused(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["report", "--robot", "sensing", "--out", str(tmp_path), *option.split()]
    assert main(arguments) == 2
    assert "does not belong here" in capsys.readouterr().err


def document(task: SensingWork) -> dict[str, Any]:
    """Figures that meet every target; an arc wins without friction and loses with it."""
    arc = 0.05 if task.friction == 0.0 else 0.9
    return {
        "seed": task.seed,
        "shape_error_mm": {"rms": 0.09},
        "polynomial_curvature": {"shape_error_mm": {"rms": 0.1}},
        "constant_curvature": {"shape_error_mm": {"rms": arc}},
        "force_error_percent": {"rms": 8.0},
        "mean_of_20": {"force_error_percent": {"rms": 2.0}},
    }


def covered(rng: np.random.Generator, count: int, width: float = 1.0) -> CoverageResult:
    """Trials with normal errors, whose covariances are ``width`` squared times too large."""
    off = rng.normal(size=(count, 4))
    return CoverageResult(
        [0.1] * count,
        [(float(one[3]), width**2) for one in off],
        [one[:3] for one in off],
        [width**2 * np.eye(3)] * count,
        [1] * count,
    )


def study(
    tmp_path: Path, rng: np.random.Generator, width: float = 1.0, quick: bool = False
) -> SensingResults:
    tasks = sensing_tasks(quick)
    found = StudyResult({task: f"run{number}" for number, task in enumerate(tasks)})
    for task, name in found.names.items():
        found.documents[task] = document(task)
        if task.experiment == COVERAGE:
            data = packed(coverage_arrays(covered(rng, task.count, width)))
            (tmp_path / f"{name}.npz").write_bytes(data)
    return SensingResults(found, StudyFolder(tmp_path))


def put(results: SensingResults, where: tuple[str, tuple[float, float], int], **more: Any) -> None:
    """Change figures of one run."""
    (task,) = [
        one
        for one in results.study.names
        if (one.experiment, one.noise, one.seed) == where
        and (one.friction, one.tension) == (FRICTION, TENSION_NOISE_N)
    ]
    results.study.documents[task] = {**copy.deepcopy(results.study.documents[task]), **more}


def unmet(results: SensingResults) -> list[SensingVerdict]:
    return [one for one in sensing_verdicts(results) if one.met is not True]


def test_figures_within_the_bounds_meet_every_target(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    results = study(tmp_path, rng)
    assert unmet(results) == []
    found = sensing_verdicts(results)
    assert len(found) == 2 + 3 + 4
    assert sum(one.remark == f"of {TRIALS} trials" for one in found) == 4
    assert len(unmet(study(tmp_path, rng, quick=True))) == len(found)


@pytest.mark.parametrize(
    ("where", "figures", "words"),
    [
        ((FORCE_LEVELS, QUIET, 3), {"shape_error_mm": {"rms": 0.11}}, "shape error, rms"),
        (
            (FORCE_LEVELS, QUIET, 5),
            {"constant_curvature": {"shape_error_mm": {"rms": 0.4}}},
            "constant curvature’s over ours",
        ),
        ((FORCE_LEVELS, NOISY, 2), {"shape_error_mm": {"rms": 0.21}}, "shape error, rms"),
        (
            (FORCE_LEVELS, NOISY, 1),
            {"force_error_percent": {"rms": 12.1}},
            "force, axis known, one sample",
        ),
        (
            (FORCE_LEVELS, NOISY, 4),
            {"mean_of_20": {"force_error_percent": {"rms": 4.1}}},
            "force, axis known, mean of 20",
        ),
    ],
)
def test_one_bad_seed_is_enough(
    tmp_path: Path,
    rng: np.random.Generator,
    where: tuple[str, tuple[float, float], int],
    figures: dict[str, Any],
    words: str,
) -> None:
    results = study(tmp_path, rng)
    put(results, where, **figures)
    (wrong,) = unmet(results)
    assert (wrong.bound.words, wrong.seed, wrong.met) == (words, where[2], False)


@pytest.mark.parametrize(("width", "share", "ratio"), [(0.4, 60.0, 0.4), (2.5, 100.0, 2.5)])
def test_regions_too_narrow_or_too_wide_are_not_met(
    tmp_path: Path, rng: np.random.Generator, width: float, share: float, ratio: float
) -> None:
    found = sensing_verdicts(study(tmp_path, rng, width))[5:]
    assert [one.met for one in found if one.bound.unit == "%"] == [False, False]
    assert [one.met for one in found if one.bound.unit == ""] == [width < 2.0] * 2
    for inside, wide in zip(found[::2], found[1::2], strict=True):
        assert inside.worst is not None
        assert inside.worst == pytest.approx(share, abs=50.0)
        assert wide.worst == pytest.approx(ratio, rel=0.15)


def test_a_missing_run_is_not_met_and_says_so(tmp_path: Path, rng: np.random.Generator) -> None:
    results = study(tmp_path, rng)
    for task in [one for one in results.study.names if one.experiment == COVERAGE]:
        del results.study.documents[task]
    wrong = unmet(results)
    assert [(one.met, one.remark) for one in wrong] == [(None, "not run")] * 4


def test_who_wins_in_free_bending_follows_from_the_figures(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    results = study(tmp_path, rng)
    words = free_words(results)
    assert "Without friction constant curvature wins: 0.050 mm" in words
    assert "constant curvature loses: 0.900 mm" in words
    for seed in SEEDS:
        put(
            results, (SHAPE_FREE, NOISY, seed), constant_curvature={"shape_error_mm": {"rms": 0.09}}
        )
    assert "(μ = 0.15) constant curvature is as good" in free_words(results)


def test_every_task_is_run_once_and_has_a_name_of_its_own() -> None:
    configuration = headless.configuration()
    tasks = sensing_tasks(quick=False)
    names = {task.name(configuration, None) for task in tasks}
    assert len(names) == len(set(tasks)) == len(tasks)
    assert sum(task.count for task in tasks if task.experiment == COVERAGE) == TRIALS
    assert {task.noise for task in tasks if task.experiment == FORCE_LEVELS} == set(NOISES)
    for name in (PULL_RELEASE, CHIRP):
        assert sum(task.experiment == name for task in tasks) == 1
    assert tasks[0].words() == (
        "coverage --noise 0.25,0.5 --tension-noise 0.02 --friction 0.15 --seed 1"
    )
