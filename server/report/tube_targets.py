"""What the concentric tubes' runs must show, and whether they do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from robot.concentric.design import METHODS
from scenes.experiments.tubes import RANDOM
from server.report.targets import Bound
from server.report.tube_results import TubeResults
from server.report.tube_table_3 import PAPER_TABLE_3
from server.report.tube_tasks import PATHS
from server.run.figure_table import figure

PAPER_METHODS = tuple(name for name in METHODS if name != "hqp")
_KEPT_MM, _OUT_MM, _ROTATION_RAD_S = 0.05, 1e-9, 0.5
_RANDOM_MM = 0.2
_ITERATIONS = {
    "nspwln": (460.0, 530.0),
    "nspwln-repaired": (None, 270.0),
    "nspqp": (235.0, 285.0),
    "snsqp": (235.0, 285.0),
}
_RELATIVE_MM = {
    "nspwln": (0.25, 0.35),
    "nspwln-repaired": (None, 0.15),
    "nspqp": (None, 0.25),
    "snsqp": (None, 0.25),
}


@dataclass(frozen=True)
class TubeVerdict:
    """What a bound has come to.

    Attributes:
        what: was run or measured.
        bound: which.
        ours: the figure; None if a run is missing.
        met: whether it is within the bound; None without a figure.
        remark: what else is to be said.
    """

    what: str
    bound: Bound
    ours: float | None
    met: bool | None
    remark: str = ""


def tube_verdicts(results: TubeResults) -> list[TubeVerdict]:
    """Every bound, in order; paths that were cut short meet nothing."""
    found = []
    for path in PATHS:
        for method in PAPER_METHODS:
            document = results.all_starts(path, method)
            words = f"run {path} --method {method}"
            found += _judged(words, document, _paper_bounds(path, method), results.whole)
    for path in PATHS:
        found += _judged(f"run {path} --method hqp", _own(results, path), _OWN, results.whole)
    count = len(results.documents(RANDOM, "hqp"))
    words = f"run random --method hqp --count {count}"
    found += _judged(words, _drawn(results), _DRAWN, results.whole)
    return found + _measured(results)


def _judged(
    what: str, document: dict[str, Any] | None, bounds: Sequence[Bound], whole: bool
) -> list[TubeVerdict]:
    found = []
    for bound in bounds:
        value = None if document is None else figure(document, bound.place)
        if not isinstance(value, int | float):
            found.append(TubeVerdict(what, bound, None, None, "not run"))
            continue
        ours = value * bound.factor
        met = whole and (bound.high is None or ours <= bound.high)
        met = met and (bound.low is None or ours >= bound.low)
        found.append(TubeVerdict(what, bound, ours, met))
    return found


def _paper_bounds(path: str, method: str) -> tuple[Bound, ...]:
    printed = PAPER_TABLE_3.get((path, method))
    fewest, most = _ITERATIONS[method]
    least, largest = _RELATIVE_MM[method]
    return (
        Bound("points reached", "reached_percent", "%", None, 100.0, paper=printed and 100.0),
        Bound(
            "iterations, mean", "iterations", "", most, fewest, paper=printed and printed.iterations
        ),
        Bound(
            "ε_AB, mean of the maxima",
            "relative_error_mm.max",
            "mm",
            largest,
            least,
            paper=printed and printed.relative.largest,
        ),
        Bound("ε_AB, largest", "maxima.relative_error_mm", "mm", largest, least),
    )


_OWN = (
    Bound("points reached", "reached_percent", "%", None, 100.0),
    Bound("iterations, beyond NSPQP’s", "beyond_nspqp_percent", "%", 10.0),
    Bound("ε_AB, every iteration", "relative_error_mm.max_any_iteration", "mm", _KEPT_MM),
    Bound("out of bounds", "bound_violation_mm", "mm", _OUT_MM),
    Bound("infeasible QPs", "infeasible_qps", "", 0.0),
    Bound("rotation, peak", "peak_rotation_rad_s", "rad/s", _ROTATION_RAD_S),
)
_DRAWN = (
    Bound("ε_AB, every iteration", "relative_error_mm.max_any_iteration", "mm", _RANDOM_MM),
    Bound("points behind the paper’s best", "behind_best", "", 0.0),
)


def _own(results: TubeResults, path: str) -> dict[str, Any] | None:
    own, other = results.all_starts(path, "hqp"), results.all_starts(path, "nspqp")
    if own is None or other is None:
        return own
    return {**own, "beyond_nspqp_percent": 100.0 * (own["iterations"] / other["iterations"] - 1.0)}


def _drawn(results: TubeResults) -> dict[str, Any] | None:
    own = results.all_starts(RANDOM, "hqp")
    others = [results.all_starts(RANDOM, method) for method in PAPER_METHODS]
    reached = [one["converged_points"] for one in others if one is not None]
    if own is None or len(reached) < len(others):
        return own
    return {**own, "behind_best": max(reached) - own["converged_points"]}


def _measured(results: TubeResults) -> list[TubeVerdict]:
    measures = results.measures
    if measures is None:
        return []
    states = f"model at {measures.states} random stable states"
    rows = [
        (states, "tip from a general ODE solver’s", "mm", 1e-6, measures.tips_apart_mm, ""),
        (states, "J against central differences", "", 1e-7, measures.jacobian_off, ""),
    ]
    for overlap, (median, late) in measures.arm_ms.items():
        rows.append(
            ("time, alone", f"one arm and its J, overlap {overlap} mm", "ms",
             1.0 if overlap else 0.1, median, f"median; 99 % within {late:.2g} ms")
        )  # fmt: skip
    median, late = measures.iteration_ms
    rows.append(
        ("time, alone", "control iteration of both arms, hqp", "ms", 1.5, median,
         f"median; 99 % within {late:.2g} ms")
    )  # fmt: skip
    return [
        TubeVerdict(what, Bound(words, "", unit, high), value, value <= high, remark)
        for what, words, unit, high, value, remark in rows
    ]
