"""Targets and claims are decided from figures: each rule, on figures made up for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.dexterity import Dexterity
from server.report import claims as rules
from server.report.measures import (
    PAPER_TABLE_5,
    DexterityRow,
    Table5,
    accuracy,
    residuals,
    table_5,
)
from server.report.results import SETTINGS, Results, Setting, tasks
from server.report.targets import TARGETS, Verdict, verdicts
from server.run.figure_table import figure
from server.study.folder import StudyFolder
from server.study.study import StudyResult
from server.study.task import Task
from tests.server import headless

SEEDS = [1, 2, 3]


def document(task: Task) -> dict[str, Any]:
    """Figures that meet every target."""
    gain = task.compensation == "gain"
    small = {"max": 0.1, "rms": 0.05, "final": 0.0}
    return {
        "experiment": task.experiment,
        "seed": task.seed,
        "ended": "completed",
        "errors": {"position_mm": small, "orientation_deg": small, "rcm_mm": small},
        "bend": {
            "theta_deg": {"max": 3.0 if gain else 0.5},
            "direction_deg": {"max": 6.0 if gain else 0.5},
        },
        "lambda": {"max_abs_error": 0.05},
        "rings": {"passed": 6},
        "ball": {"progress": 1.0},
    }


def study() -> StudyResult[Task]:
    found = StudyResult(dict.fromkeys(tasks("physics", "paper", SEEDS, None), ""))
    found.documents = {task: document(task) for task in found.names}
    return found


def judged(found: StudyResult[Task], tmp_path: Path, whole: bool = True) -> list[Verdict]:
    return verdicts(Results(found, StudyFolder(tmp_path)), whole)


def put(found: StudyResult[Task], setting: Setting, seed: int, place: str, value: Any) -> None:
    """Put a value into the figures of one run."""
    (task,) = [
        one
        for one in found.names
        if (one.experiment, one.case, one.tracker, one.compensation, one.seed) == (*setting, seed)
    ]
    own = document(task) if task not in found.documents else found.documents[task]
    *path, last = place.split(".")
    for key in path:
        own[key] = dict(own[key])
        own = own[key]
    own[last] = value


def test_figures_within_the_bounds_meet_every_target(tmp_path: Path) -> None:
    found = judged(study(), tmp_path)
    assert all(verdict.met for verdict in found)
    assert len(found) == sum(len(target.bounds) for target in TARGETS)
    assert not any(verdict.met for verdict in judged(study(), tmp_path, whole=False))


@pytest.mark.parametrize("place", range(sum(len(target.bounds) for target in TARGETS)))
def test_one_bad_seed_is_the_worst_and_enough(tmp_path: Path, place: int) -> None:
    pairs = [(target, bound) for target in TARGETS for bound in target.bounds]
    target, bound = pairs[place]
    for limit, factor in ((bound.high, 1.01), (bound.low, 0.99)):
        if limit is None:
            continue
        found = study()
        value = factor * limit / bound.factor
        seeds = [2] if not (bound.low and bound.high) else SEEDS
        for seed in seeds:
            put(found, target.setting, seed, bound.place, value)
        verdict = judged(found, tmp_path)[place]
        assert not verdict.met
        assert verdict.worst == pytest.approx(factor * limit)
        assert verdict.seed in seeds


def test_what_shall_be_like_the_paper_s_is_so_on_every_seed(tmp_path: Path) -> None:
    found = study()
    put(found, TARGETS[0].setting, 2, "bend.theta_deg.max", 2.0)
    first, second = judged(found, tmp_path)[:2]
    assert not first.met
    assert second.met


def test_a_run_that_was_stopped_meets_nothing_and_says_why(tmp_path: Path) -> None:
    found = study()
    put(found, TARGETS[0].setting, 2, "ended", "emergency stop")
    first = judged(found, tmp_path)[0]
    assert not first.met
    assert first.remark == "stopped: emergency stop"


def claim(found: list[rules.Claim], words: str) -> rules.Claim:
    (one,) = [one for one in found if words in one.words]
    return one


def written(tmp_path: Path, residual: dict[str, tuple[float, float]]) -> Results:
    """Results whose circles have these residuals by case (m/s, rad/s)."""
    found = study()
    folder = StudyFolder(tmp_path)
    for number, task in enumerate(found.names):
        found.names[task] = name = f"run{number}"
        detail = np.zeros((50, 14))
        if task.experiment == "circle" and not task.tracker:
            detail[:, 1], detail[:, 2] = residual[task.case]
        trace = np.zeros((50, 28))
        trace[:, 1:8] = [0.1, -0.4, 0.2, 0.9, 0.1, 0.6, 0.0]
        trace[:, 8], trace[:, 10] = 1.0, 0.4
        with open(folder.path / f"{name}.npz", "wb") as file:
            np.savez(file, trace=trace, detail=detail, errors=np.zeros((50, 3)))
    return Results(found, folder)


def test_residuals_decide_what_figure_11_claims(tmp_path: Path) -> None:
    apart = {"0": (0.02, 0.3), "1": (0.001, 0.2), "2": (0.015, 0.01)}
    results = written(tmp_path, apart)
    by_case = residuals(results, "circle")
    assert by_case is not None
    assert by_case["0"] == pytest.approx((20.0, np.degrees(0.3)), rel=1e-6)
    found = [one for one in rules.claims(results, None) if one.source == "Fig. 11, circle"]
    assert [one.holds for one in found] == [True, True, True]


@pytest.mark.parametrize(
    "by_case",
    [
        {"0": (1e-9, 1e-9), "1": (0.0, 1e-9), "2": (1e-9, 0.0)},
        {"0": (0.02, 0.3), "1": (0.0199, 0.2), "2": (0.02, 0.2999)},
    ],
)
def test_residuals_that_are_alike_or_nothing_decide_against_it(
    tmp_path: Path, by_case: dict[str, tuple[float, float]]
) -> None:
    found = rules.claims(written(tmp_path, by_case), None)
    assert not any(one.holds for one in found if one.source == "Fig. 11, circle")


def test_accuracy_on_rings_and_silicon_decides_the_trade(tmp_path: Path) -> None:
    found = study()
    for seed in SEEDS:
        for case, position, orientation in (("1", 0.1, 2.0), ("2", 0.5, 1.0)):
            setting = Setting("ring-board", case, True)
            put(found, setting, seed, "errors.position_mm.max", position)
            put(found, setting, seed, "errors.orientation_deg.max", orientation)
    results = Results(found, StudyFolder(tmp_path))
    assert accuracy(results, Setting("ring-board", "2", True), "max") == (0.5, 1.0)
    decided = rules._trade(results, "ring-board", "here") + rules._trade(
        results, "silicon-arc", "here"
    )
    assert [one.holds for one in decided] == [True, False]
    assert not rules._five_percent(results)[0].holds


def test_the_paper_s_own_table_bears_out_half_of_what_it_claims() -> None:
    found = rules._dexterity(Table5(PAPER_TABLE_5, PAPER_TABLE_5))
    assert [one.holds for one in found] == [True, True, True, True]
    flat = {case: DexterityRow(0.5, 0.5, 0.5, 0.5) for case in "012"}
    assert [one.holds for one in rules._dexterity(Table5(flat, flat))] == [False] * 4


def test_table_5_holds_the_measures_of_the_configurations(tmp_path: Path) -> None:
    results = written(tmp_path, dict.fromkeys("012", (0.0, 0.0)))
    table = table_5(results, headless.configuration())
    assert table is not None
    phi = 0.5 * np.pi - 1.0
    x = np.array([0.1, -0.4, 0.2, 0.9, 0.1, 0.6, 0.0, phi, 0.0, 0.4])
    dexterity = Dexterity(headless.configuration())
    linear, angular = dexterity.jacobians(x)[1:]
    for case in "012":
        row = table.raw[case]
        for jacobian, inverse, product in (
            (linear, row.inverse_linear, row.linear),
            (angular, row.inverse_angular, row.angular),
        ):
            values = np.linalg.svd(jacobian, compute_uv=False)
            assert inverse == pytest.approx(values[-1] / values[0], rel=1e-5)
            assert product == pytest.approx(np.prod(values), rel=1e-5)
    assert table.projected["1"].angular < table.projected["0"].angular


def test_figures_are_found_by_their_place() -> None:
    assert figure({"a": {"b": 1}}, "a.b") == 1
    assert figure({"a": {"b": 1}}, "a.c") is None
    assert figure({"a": 2}, "a.b") is None
    assert len(SETTINGS) == len(set(SETTINGS))
