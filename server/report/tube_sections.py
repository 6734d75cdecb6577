"""The report's part on the two concentric-tube arms, section by section."""

from __future__ import annotations

from typing import Any

from robot.concentric.design import METHODS
from robot.configuration import Configuration
from scenes.experiments.tubes import NEAR_INFEASIBLE, RANDOM
from server.report import markup
from server.report.markup import Cell
from server.report.tube_claims import tube_claims
from server.report.tube_plots import actuation_plot, scaling_plot, trade_off_plot
from server.report.tube_results import TubeResults
from server.report.tube_table_3 import out_of_bounds, table_3
from server.report.tube_targets import TubeVerdict, tube_verdicts
from server.report.tube_tasks import LABELS, LINE_METHODS, LINE_MM, LINES, RANDOM_SEED
from server.report.verdict_tables import claims_section, verdict_cell

LINKS = (
    ("tubes-targets", "Targets"),
    ("tubes-claims", "Claims"),
    ("tubes-table-3", "Table 3"),
    ("tubes-actuation", "Fig. 2: actuation"),
    ("tubes-scaling", "Task scaling"),
    ("tubes-trade-off", "Translation and speed"),
    ("tubes-random", "Random configurations"),
)
"""Anchors of the sections and what they are called."""


def tube_sections(results: TubeResults, configuration: Configuration) -> str:
    """All of them, one after the other."""
    speed = configuration.concentric.limits.translation_speed_mm_s
    return "".join(
        (
            _head(results),
            _targets(tube_verdicts(results)),
            claims_section(
                "tubes-claims",
                "What the paper claims of concentric tubes",
                tube_claims(results, speed),
                "Each is decided by the rule beside it.",
            ),
            table_3(results),
            _actuation(results),
            _scaling(results),
            _trade_off(results, speed),
            _random(results),
        )
    )


def _head(results: TubeResults) -> str:
    parts = [
        '<header id="tubes"><h1>Two concentric-tube arms through one endoscope</h1>',
        markup.paragraph(
            "Paper 2 (Alsaka, Cinquin & Chikhaoui 2024): arm A follows a path, arm B keeps its "
            "place beside A. Both are simulations of the same model, at T = 0.1 s, so figures "
            "compare; NSPWLN, NSPQP and SNSQP are the paper’s methods, HQP is Keyhole’s. ε_AB is "
            "the error of B’s place beside A, ε_A that of A on the path."
        ),
    ]
    if not results.whole:
        words = "Only the first points of each path were played: no target counts as met."
        parts.append(markup.paragraph(words, "note"))
    return "".join(parts) + "</header>"


def _targets(found: list[TubeVerdict]) -> str:
    rows: list[list[Cell | str]] = []
    for place, verdict in enumerate(found):
        bound = verdict.bound
        row: list[Cell | str] = []
        if place == 0 or found[place - 1].what != verdict.what:
            row.append(Cell(verdict.what, "", sum(one.what == verdict.what for one in found)))
        paper = "–" if bound.paper is None else f"{bound.paper:g} {bound.unit}"
        ours = "–" if verdict.ours is None else f"{_shown(verdict)} {bound.unit}"
        row += [
            bound.words,
            Cell(paper, "number"),
            Cell(bound.allowed(), "number"),
            Cell(ours, "number"),
            verdict_cell(verdict.met, "met", "not met"),
            verdict.remark,
        ]
        rows.append(row)
    met = sum(verdict.met is True for verdict in found)
    return markup.section(
        "tubes-targets",
        "Targets of the concentric tubes",
        markup.paragraph(
            f"{met} of {len(found)} met. Iterations are means over the three configurations; ε_AB "
            "is taken when a point is left, as the mean of the configurations’ maxima, as the "
            "paper’s Table 3 has it, and as the largest of them; “every iteration” takes all inner "
            "iterations. Whether the console’s control keeps its rate with these arms is not "
            "measured here."
        ),
        markup.card(
            markup.table(("what", "figure", "#paper", "#wanted", "#ours", "verdict", ""), rows)
        ),
    )


def _shown(verdict: TubeVerdict) -> str:
    """A figure, with the rounding of numbers as none."""
    value = verdict.ours
    assert value is not None
    if verdict.bound.words == "out of bounds":
        return out_of_bounds(value)
    if verdict.bound.unit == "%":
        return f"{value:.1f}".removesuffix(".0").replace("-", "−")
    return markup.number(value)


def _actuation(results: TubeResults) -> str:
    where = results.furthest_out()
    if where is None:
        return ""
    path, start = where
    plots = (
        markup.figure(
            actuation_plot(results, path, start, arm, f"tubes-actuation-{arm}"),
            f"Robot {arm.upper()}, {path}, configuration {start}; compare Fig. 2, "
            f"{'top' if arm == 'a' else 'bottom'}.",
        )
        for arm in "ab"
    )
    return markup.section(
        "tubes-actuation",
        "Fig. 2: tubes between their moving bounds",
        markup.paragraph(
            "The paper shows one run, in which NSPWLN leaves its bounds, and does not say which; "
            f"this is the one in which ours leaves them furthest ({path}, configuration {start}). "
            "The bounds are those of eq. (1) with the margins for segment length and motor "
            "spacing: they move with the tube inside. Each point shows the tube when it was left; "
            "crosses (on every fourth such point) say that it was out of bounds in an iteration on "
            "the way there."
        ),
        f'<div class="card plots">{"".join(plots)}</div>',
    )


def _scaling(results: TubeResults) -> str:
    plot = markup.figure(
        scaling_plot(results, "tubes-scaling"),
        "The first 320 iterations. Where NSPQP’s line is level it stands still until 100 "
        "iterations are over, point after point; a mark stands where a run has reached its end. "
        "Only SNSQP has task scales: of ε_AB dotted, of ε_A thin.",
    )
    if not plot:
        return ""
    rows: list[list[Cell | str]] = [
        [LABELS[method], one["configuration"], *_scaling_cells(one)]
        for method in METHODS
        for one in results.documents(NEAR_INFEASIBLE, method)
    ]
    heads = (
        *("method", "configuration", "#points", "#iterations", "#infeasible QPs"),
        *("#ε_AB when left, largest, mm", "#rotation, rad/s", "#speed, mm/s", "#out of bounds, mm"),
    )
    return markup.section(
        "tubes-scaling",
        "Task scaling where a task is nearly infeasible",
        markup.paragraph(
            "The Lissajous figure, while B is asked to be 5 mm further back from the first "
            "iteration on: λ_AB·5 mm = 25 mm/s is more than tubes that go 5 mm/s can do. The "
            "equality of NSPQP then has no solution, and nothing moves, unless rotations, which it "
            "does not bound, can do the rest; SNSQP scales the task down, HQP takes it as far as "
            "it goes. The first iterations cannot keep ε_AB, whatever the method."
        ),
        f'<div class="card plots">{plot}</div>',
        markup.card(markup.table(heads, rows)),
        _lines(results),
    )


def _lines(results: TubeResults) -> str:
    """How far A gets on straight lines, toward places that it cannot reach."""
    found = {
        method: [one for line in LINES for one in results.documents(line, method)]
        for method in LINE_METHODS
    }
    if not all(found.values()):
        return ""
    rows: list[list[Cell | str]] = []
    for method, runs in found.items():
        texts = (
            f"{sum(one['converged_points'] == one['points'] for one in runs)}/{len(runs)}",
            f"{sum(one['converged_points'] for one in runs) / len(runs):.1f}",
            f"{max(one['relative_error_mm']['max_any_iteration'] for one in runs):.3f}",
            out_of_bounds(max(one["bound_violation_mm"] for one in runs)),
            f"{max(one['peak_rotation_rad_s'] for one in runs):.2f}",
        )
        rows.append([LABELS[method], *(Cell(text, "number") for text in texts)])
    heads = (
        *("method", "#whole lines", "#mean way, mm", "#ε_AB ever, mm", "#out of bounds, mm"),
        "#rotation, rad/s",
    )
    return markup.paragraph(
        f"There it is the speed that makes the task infeasible. Where it is the place, on lines of "
        f"{LINE_MM} mm along both directions of every axis from every configuration, a scale of 0 "
        "is all that scaling can offer: this is how far each gets before it misses a point."
    ) + markup.card(markup.table(heads, rows))


def _scaling_cells(one: dict[str, Any]) -> list[Cell]:
    texts = (
        f"{one['converged_points']}/{one['points']}",
        str(one["iterations"]),
        str(one["infeasible_qps"]),
        f"{one['relative_error_mm']['max']:.3f}",
        f"{one['peak_rotation_rad_s']:.2f}",
        f"{one['peak_translation_mm_s']:.1f}",
        out_of_bounds(one["bound_violation_mm"]),
    )
    return [Cell(text, "number") for text in texts]


def _trade_off(results: TubeResults, speed: float) -> str:
    plot = markup.figure(
        trade_off_plot(results, speed, "tubes-trade-off"),
        "Each mark is one of the three configurations. Translation is the way of all six tubes "
        "together; the mean speed is that of one tube while the path is played.",
    )
    if not plot:
        return ""
    return markup.section(
        "tubes-trade-off",
        "Translation of the tubes against their speed",
        f'<div class="card plots">{plot}</div>',
    )


def _random(results: TubeResults) -> str:
    rows: list[list[Cell | str]] = []
    count = 0
    for method in METHODS:
        one, runs = results.all_starts(RANDOM, method), results.documents(RANDOM, method)
        if one is None:
            continue
        count = len(runs)
        whole = sum(run["converged_points"] == run["points"] for run in runs)
        refused = sum(one["refused_iterations"].values())
        texts = (
            f"{one['converged_points']}/{one['points']}",
            f"{whole}/{len(runs)}",
            f"{one['iterations']:.0f}",
            f"{one['maxima']['relative_error_mm']:.3f}",
            f"{one['relative_error_mm']['max_any_iteration']:.3f}",
            out_of_bounds(one["bound_violation_mm"]),
            str(one["infeasible_qps"]),
            str(refused),
            f"{one['peak_rotation_rad_s']:.2f}",
            f"{one['peak_translation_mm_s']:.1f}",
        )
        rows.append([LABELS[method], *(Cell(text, "number") for text in texts)])
    if not rows:
        return ""
    heads = (
        *("method", "#points reached", "#whole paths", "#iterations, mean"),
        *("#ε_AB when left, largest, mm", "#ε_AB ever, mm", "#out of bounds, mm"),
        *("#infeasible QPs", "#refused", "#rotation, rad/s", "#speed, mm/s"),
    )
    return markup.section(
        "tubes-random",
        "Random configurations",
        markup.paragraph(
            f"The Lissajous figure from {count} configurations drawn with seed {RANDOM_SEED}, "
            "with which no method was tuned: inside (1), stable, tubes turned anyhow. "
            "“Refused” counts iterations in which nothing moved because the model found no "
            "stable solution or no step kept the relative position."
        ),
        markup.card(markup.table(heads, rows)),
    )
