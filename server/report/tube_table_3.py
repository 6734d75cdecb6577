"""Table 3 of Paper 2 (Alsaka, Cinquin & Chikhaoui 2024) as printed, and ours beside it."""

from __future__ import annotations

from typing import Any, NamedTuple

from robot.concentric.design import METHODS
from server.report import markup
from server.report.markup import Cell
from server.report.tube_results import TubeResults
from server.report.tube_tasks import LABELS, PATHS


class Spread(NamedTuple):
    """RMS ± standard deviation [largest], mm."""

    rms: float
    deviation: float
    largest: float

    def words(self, digits: int) -> str:
        """As the paper prints it."""
        return f"{self.rms:.{digits}f} ± {self.deviation:.{digits}f} [{self.largest:.{digits}f}]"


class PaperRow(NamedTuple):
    """A row of the paper's Table 3: ε_AB and ε_A when a point is left."""

    iterations: float
    relative: Spread
    tracking: Spread


PAPER_TABLE_3 = {
    ("rectangle", "nspwln"): PaperRow(523, Spread(0.33, 0.05, 0.35), Spread(0.79, 0.08, 0.82)),
    ("rectangle", "nspqp"): PaperRow(269, Spread(0.01, 0.02, 0.02), Spread(0.72, 0.10, 0.81)),
    ("rectangle", "snsqp"): PaperRow(261, Spread(0.02, 0.03, 0.05), Spread(0.70, 0.11, 0.74)),
    ("lissajous", "nspwln"): PaperRow(513, Spread(0.31, 0.04, 0.33), Spread(0.78, 0.07, 0.81)),
    ("lissajous", "nspqp"): PaperRow(279, Spread(0.03, 0.04, 0.09), Spread(0.72, 0.10, 0.75)),
    ("lissajous", "snsqp"): PaperRow(259, Spread(0.06, 0.08, 0.13), Spread(0.71, 0.10, 0.76)),
}
"""As printed, by path and method. There is no repaired NSPWLN in it, and no HQP."""

_REMARKS = """<ul>
<li><strong>Chosen, not printed.</strong> The paper prints neither the number of points nor the
planes of its trajectories. Ours have 100 points of about 1 mm, in planes that all three
configurations reach; that iterations agree is therefore partly by construction.</li>
<li><strong>NSPWLN as printed.</strong> Eq. (6) inverts the left and the right half of J_AB
separately, so J_AB·inv(J_AB) = 2I and I − inv(J_AB)·J_AB is no projector: A’s motion enters
ε_AB turned around, which doubles the iterations and leaves a third of a millimetre. The repaired
one inverts the stacked tasks at once, and needs half as many.</li>
<li><strong>Empty cells.</strong> The paper has no repaired NSPWLN and no HQP.</li>
<li><strong>Every iteration.</strong> The paper takes errors when a point is left. What happens on
the way there is in the columns “ever”: the largest over every inner iteration of every
configuration.</li>
</ul>"""


def table_3(results: TubeResults) -> str:
    """The section."""
    heads = (
        *("path", "method", "#iterations: paper", "#ours"),
        *("#ε_AB, mm: paper", "#ours", "#ever", "#ε_A, mm: paper", "#ours"),
        *("#out of bounds, mm", "#infeasible QPs", "#rotation, rad/s"),
    )
    rows: list[list[Cell | str]] = []
    for path in PATHS:
        for method in METHODS:
            first = [Cell(path, "", len(METHODS))] if method == METHODS[0] else []
            printed = PAPER_TABLE_3.get((path, method))
            own = results.all_starts(path, method)
            rows.append([*first, LABELS[method], *_cells(printed, own)])
    return markup.section(
        "tubes-table-3",
        "Table 3: both paths, all methods",
        markup.paragraph(
            "RMS ± standard deviation [largest] when a point is left, each the mean over the three "
            "configurations, as in the paper."
        ),
        markup.card(markup.table(heads, rows)),
        _REMARKS,
    )


def _cells(printed: PaperRow | None, own: dict[str, Any] | None) -> list[Cell]:
    paper = ("", "", "")
    if printed is not None:
        paper = (f"{printed.iterations:.0f}", printed.relative.words(2), printed.tracking.words(2))
    ours = [""] * 7
    if own is not None:
        ours = [
            f"{own['iterations']:.0f}",
            spread_of(own, "relative_error_mm").words(3),
            f"{own['relative_error_mm']['max_any_iteration']:.3f}",
            spread_of(own, "tracking_error_mm").words(2),
            out_of_bounds(own["bound_violation_mm"]),
            str(own["infeasible_qps"]),
            f"{own['peak_rotation_rad_s']:.2f}",
        ]
    texts = (paper[0], ours[0], paper[1], ours[1], ours[2], paper[2], *ours[3:])
    return [Cell(text, "number") for text in texts]


def spread_of(document: dict[str, Any], error: str) -> Spread:
    """RMS, deviation and largest of an error of a run's document."""
    return Spread(*(float(document[error][key] or 0.0) for key in ("rms", "std", "max")))


def out_of_bounds(violation_mm: float) -> str:
    """A violation of the bounds for people; rounding of numbers is none."""
    return "0" if violation_mm < 1e-9 else f"{violation_mm:.2g}"
