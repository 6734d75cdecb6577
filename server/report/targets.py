"""What the simulated robot must show beside what the paper's showed, and whether it does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from server.report.results import Results, Setting
from server.run.figure_table import figure

BALL_AT_END = 0.98
_RAD = math.pi / 180.0
_POSITION, _ORIENTATION = "errors.position_mm.max", "errors.orientation_deg.max"


@dataclass(frozen=True)
class Bound:
    """One figure of a run and what it may be.

    Attributes:
        words: what it is.
        place: where it stands in a run's document.
        unit: after ``factor``.
        high: at most; None without an upper bound.
        low: at least.
        factor: from the document's unit.
        paper: the paper's figure in the same unit, None where it has none.
        smallest: whether the worst seed is that with the smallest figure.
    """

    words: str
    place: str
    unit: str
    high: float | None = None
    low: float | None = None
    factor: float = 1.0
    paper: float | None = None
    smallest: bool = False

    def allowed(self) -> str:
        """For people."""
        if self.low is not None and self.high is not None:
            return f"{self.low:g} to {self.high:g} {self.unit}"
        if self.high is not None:
            return f"≤ {self.high:g} {self.unit}"
        return f"≥ {self.low:g} {self.unit}"


@dataclass(frozen=True)
class Target:
    """A row of the table of targets: a setting and its bounds."""

    setting: Setting
    bounds: tuple[Bound, ...]


@dataclass(frozen=True)
class Verdict:
    """What a bound has come to.

    Attributes:
        target: whose.
        bound: which.
        worst: worst figure over the seeds in the bound's unit; None if no run is finished.
        seed: the seed it comes from.
        met: whether it is within the bound on every seed, and every run was played to its end.
        remark: what else is to be said.
    """

    target: Target
    bound: Bound
    worst: float | None
    seed: int | None
    met: bool
    remark: str = ""


def _like(paper: float, words: str, place: str) -> Bound:
    """Within 20 % of the paper's figure, either way."""
    return Bound(words, place, "°", round(1.2 * paper, 6), round(0.8 * paper, 6), paper=paper)


def _pose(
    position: float,
    orientation: float,
    paper_position: float | None,
    paper_orientation: float | None,
) -> tuple[Bound, ...]:
    return (
        Bound("position", _POSITION, "mm", position, paper=paper_position),
        Bound("orientation", _ORIENTATION, "°", orientation, paper=paper_orientation),
    )


def _pushing(shape: str) -> tuple[Target, ...]:
    paper = {"1": (3.2, 6.0), "2": (5.0, 5.0)} if shape == "arc" else {}
    wanted = {"1": (1.0, 3.0), "2": (2.0, 2.0)}
    end = Bound("ball along the groove", "ball.progress", "%", None, 100 * BALL_AT_END, 100.0,
                100.0, smallest=True)  # fmt: skip
    return tuple(
        Target(
            Setting(f"silicon-{shape}", case, True),
            (end, *_pose(*wanted[case], *paper.get(case, (None, None)))),
        )
        for case in "12"
    )


def _rings(case: str, wanted: tuple[float, float], paper: tuple[float, float]) -> Target:
    through = Bound("rings passed half-way", "rings.passed", "of 6", None, 6.0, smallest=True)
    return Target(Setting("ring-board", case, True), (through, *_pose(*wanted, *paper)))


TARGETS: tuple[Target, ...] = (
    Target(
        Setting("arc", "0", False, "gain"),
        (
            _like(3.0, "θ", "bend.theta_deg.max"),
            _like(6.0, "δ", "bend.direction_deg.max"),
        ),
    ),
    Target(
        Setting("arc", "0", False, "full"),
        (
            Bound("θ", "bend.theta_deg.max", "°", 1.5),
            Bound("δ", "bend.direction_deg.max", "°", 2.5),
        ),
    ),
    Target(
        Setting("circle", "0"),
        (
            Bound("position", _POSITION, "mm", 1.0, paper=2.8),
            Bound("orientation", _ORIENTATION, "rad", 0.03, factor=_RAD, paper=0.05),
            Bound("shaft from the trocar", "errors.rcm_mm.max", "mm", 0.3),
        ),
    ),
    Target(
        Setting("circle", "0", True),
        (
            Bound("position", _POSITION, "mm", 0.35),
            Bound("orientation", _ORIENTATION, "rad", 0.014, factor=_RAD),
        ),
    ),
    Target(Setting("circle-yz", "0", True), (Bound("position", _POSITION, "mm", 0.35, paper=1.0),)),
    Target(
        Setting("square", "0"),
        (Bound("position, RMSE", "errors.position_mm.rms", "mm", 0.8, paper=3.2),),
    ),
    *_pushing("sine"),
    *_pushing("arc"),
    _rings("1", (1.0, 3.0), (3.0, 5.04)),
    _rings("2", (2.0, 1.5), (6.0, 2.45)),
)
"""Largest errors over a run, worst seed; the paper's figures are those of its section 5."""


def verdicts(results: Results, whole: bool) -> list[Verdict]:
    """Every bound of every target, in order.

    Args:
        results: the finished runs.
        whole: whether the paths were played to their ends; what was cut short meets nothing.
    """
    return [
        _verdict(target, bound, results.documents(target.setting), whole)
        for target in TARGETS
        for bound in target.bounds
    ]


def _verdict(target: Target, bound: Bound, documents: list[dict[str, Any]], whole: bool) -> Verdict:
    found = []
    for document in documents:
        value = figure(document, bound.place)
        if isinstance(value, int | float):
            found.append((value * bound.factor, int(document["seed"])))
    if not found:
        return Verdict(target, bound, None, None, False, "not run")
    worst, seed = min(found) if bound.smallest else max(found)
    stops = sorted({document["ended"] for document in documents} - {"completed"})
    values = [value for value, _ in found]
    met = not stops and whole
    met = met and (bound.high is None or max(values) <= bound.high)
    met = met and (bound.low is None or min(values) >= bound.low)
    return Verdict(target, bound, worst, seed, met, f"stopped: {'; '.join(stops)}" if stops else "")
