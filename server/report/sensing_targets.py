"""What shape and force sensing must show, and whether it does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from scenes.experiments.sensing import COVERAGE, FORCE_LEVELS
from server.report.sensing_results import SensingResults
from server.report.sensing_tasks import NOISY, QUIET
from server.report.targets import Bound
from server.run.figure_table import figure
from server.run.sensing_options import TRIALS

_SHAPE, _ARC = "shape_error_mm.rms", "constant_curvature.shape_error_mm.rms"
_TIMES = "times_better"
_QUIET = (
    Bound("shape error, rms", _SHAPE, "mm", 0.10),
    Bound("constant curvature’s over ours", _TIMES, "", None, 5.0, smallest=True),
)
_NOISY = (
    Bound("shape error, rms", _SHAPE, "mm", 0.20),
    Bound("force, axis known, one sample", "force_error_percent.rms", "%", 12.0),
    Bound("force, axis known, mean of 20", "mean_of_20.force_error_percent.rms", "%", 4.0),
)
_COVERED = tuple(
    bound
    for key, words, width in (
        ("axis_known", "axis known", "width_ratio"),
        ("axis_free", "axis free", "width_ratio_max"),
    )
    for bound in (
        Bound(f"truth inside the 95 % region, {words}", f"{key}.inside_percent", "%", 99.0, 90.0),
        Bound(f"region over the errors’ spread, {words}", f"{key}.{width}", "", 2.0),
    )
)


@dataclass(frozen=True)
class SensingVerdict:
    """What a bound has come to.

    Attributes:
        what: was run.
        bound: which.
        worst: the worst figure over the seeds; None if a run is missing.
        seed: that it comes from; None where all are taken together.
        met: whether it is within the bound; None without a figure.
        remark: what else is to be said.
    """

    what: str
    bound: Bound
    worst: float | None
    seed: int | None
    met: bool | None
    remark: str = ""


def sensing_verdicts(results: SensingResults) -> list[SensingVerdict]:
    """Every bound, in order; too few samples or trials meet nothing."""
    found = []
    for noise, bounds in ((QUIET, _QUIET), (NOISY, _NOISY)):
        what = f"run {FORCE_LEVELS} --noise {noise[0]:g},{noise[1]:g}"
        documents = [_with_ratio(one) for one in results.documents(FORCE_LEVELS, noise)]
        found += [_judged(what, bound, documents, results.whole) for bound in bounds]
    covered = results.coverage()
    what = f"run {COVERAGE} --noise {NOISY[0]:g},{NOISY[1]:g}"
    whole = results.whole and covered is not None and covered["trials"] >= TRIALS
    for bound in _COVERED:
        one = _judged(what, bound, [] if covered is None else [covered], whole)
        remark = one.remark if covered is None else f"of {covered['trials']} trials"
        found.append(SensingVerdict(what, bound, one.worst, None, one.met, remark))
    return found


def _with_ratio(document: dict[str, Any]) -> dict[str, Any]:
    ours, arc = figure(document, _SHAPE), figure(document, _ARC)
    assert isinstance(ours, float)
    assert isinstance(arc, float)
    return {**document, _TIMES: arc / ours}


def _judged(
    what: str, bound: Bound, documents: Sequence[dict[str, Any]], whole: bool
) -> SensingVerdict:
    values = [
        (value, int(document["seed"]))
        for document in documents
        if isinstance(value := figure(document, bound.place), int | float)
    ]
    if not values or len(values) < len(documents):
        return SensingVerdict(what, bound, None, None, None, "not run")
    choose: Callable[..., tuple[float, int]] = min if bound.smallest else max
    worst, seed = choose(values)
    met = whole and all(
        (bound.high is None or value <= bound.high) and (bound.low is None or value >= bound.low)
        for value, _ in values
    )
    return SensingVerdict(what, bound, worst, seed, met)
