"""The report's part on each experiment: the paper's figures, ours, and the plots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from robot.configuration import Configuration
from server.report import markup
from server.report.experiment_plots import bend_limit_plot, bend_plot, errors_plot, path_plot
from server.report.results import SETTINGS, Results, Setting
from server.run.figure_table import figure


@dataclass(frozen=True)
class Part:
    """One experiment of the report.

    Attributes:
        experiment: its name.
        title: for people.
        paper: what the paper found, and where.
        remark: what else is to be said.
    """

    experiment: str
    title: str
    paper: str
    remark: str = ""


PARTS = (
    Part(
        "arc",
        "Arc by the segment alone",
        "Section 5.2, Fig. 9: at most 3° in θ and 6° in δ, arm locked, on hardware.",
        "With compensation gain this is what the preset is tuned to: a fit. Without compensation "
        "the tendons' stretch shows as it is; with full compensation friction is met as well.",
    ),
    Part(
        "arc-stylus",
        "The same arc as a stylus asks for it",
        "Section 5.2: the operator led by a haptic stylus.",
        "The stylus path is a model of a hand: the paper gives no record of one.",
    ),
    Part(
        "circle",
        "Circle in the x-y plane",
        "Section 5.3, Fig. 10a: at most 2.8 mm and 0.05 rad (2.9°), case 0, in simulation.",
    ),
    Part(
        "circle-yz",
        "Circle in the y-z plane",
        "Section 5.3, Fig. 10a-4: less than 1 mm, case 0, in simulation.",
    ),
    Part(
        "square",
        "Square from peg to peg",
        "Section 5.3, Fig. 10b: 3.2 mm RMSE, on hardware.",
    ),
    Part(
        "circle-infeasible",
        "Circle that cannot be followed",
        "Not in the paper: position and orientation cannot both be met, so the cases must differ.",
        "What each case gives up here is what its priority means.",
    ),
    Part(
        "silicon-sine",
        "Ball along the sine groove",
        "Section 5.4, Fig. 13: the ball reaches the end; no figures for the sine alone.",
    ),
    Part(
        "silicon-arc",
        "Ball along the arc groove",
        "Section 5.4, Fig. 13: 3.2 mm and 6° (case 1), 5 mm and 5° (case 2).",
    ),
    Part(
        "ring-board",
        "Half-way through the rings",
        "Section 5.4, Fig. 14: 3 mm and 5.04° (case 1), 6 mm and 2.45° (case 2).",
    ),
)


def experiments(results: Results, configuration: Configuration) -> str:
    """All parts, one after the other."""
    return "".join(_part(part, results, configuration) for part in PARTS)


def _part(part: Part, results: Results, configuration: Configuration) -> str:
    settings = [one for one in SETTINGS if one.experiment == part.experiment]
    settings = [one for one in settings if results.documents(one)]
    if not settings:
        return ""
    key = part.experiment
    plots = [
        markup.figure(
            path_plot(results, settings, f"{key}-path"),
            "Path of the tip from where it starts: desired (dotted) and true, every seed.",
        ),
        markup.figure(
            errors_plot(results, settings, f"{key}-errors"),
            "Desired minus true over time: median over the seeds, with their range as a band.",
        ),
    ]
    if key.startswith("arc"):
        bend = bend_plot(results, settings, f"{key}-bend")
        words = "Bend and direction, desired (dotted) and true, every seed; compare Fig. 9."
        plots.insert(1, markup.figure(bend, words))
    if key == "circle-infeasible":
        limit = configuration.limits.bend_deg
        plots.append(
            markup.figure(bend_limit_plot(results, limit, f"{key}-bend"), "Bend of the segment.")
        )
    return markup.section(
        f"experiment-{key}",
        part.title,
        f"<p><strong>Paper.</strong> {markup.text(part.paper)} {markup.text(part.remark)}</p>",
        markup.card(_figures(settings, results)),
        f'<div class="card plots">{"".join(plots)}</div>',
    )


_COLUMNS = (
    ("position, mm", "errors.position_mm.max"),
    ("rms", "errors.position_mm.rms"),
    ("orientation, °", "errors.orientation_deg.max"),
    ("rms", "errors.orientation_deg.rms"),
    ("trocar, mm", "errors.rcm_mm.max"),
    ("θ, °", "bend.theta_deg.max"),
    ("δ, °", "bend.direction_deg.max"),
    ("contact, N", "contact.max_force_n"),
    ("rings", "rings.passed"),
    ("touched", "rings.touched"),
    ("ball, %", "ball.progress"),
)
_SMALLEST = {"rings.passed", "ball.progress"}


def _figures(settings: list[Setting], results: Results) -> str:
    """Worst figure over the seeds of every setting."""
    shown = [column for column in _COLUMNS if _says(column[1], settings, results)]
    rows = []
    for setting in settings:
        documents = results.documents(setting)
        ended = sorted({document["ended"] for document in documents})
        row: list[markup.Cell | str] = [setting.words(), str(len(documents))]
        for _, place in shown:
            row.append(markup.Cell(markup.number(_worst(place, documents)), "number"))
        row.append(", ".join(ended))
        rows.append(row)
    heads = ["run", "seeds", *(f"#{name}" for name, _ in shown), "ended"]
    return markup.table(heads, rows) + markup.paragraph(
        "Largest errors over the run, worst seed.", "small"
    )


def _worst(place: str, documents: list[dict[str, Any]]) -> float | None:
    """The worst figure over the seeds, ball's progress in percent; None without any."""
    values = [_number(figure(one, place)) for one in documents]
    found = [value for value in values if value is not None]
    if not found:
        return None
    worst = min(found) if place in _SMALLEST else max(found)
    return 100.0 * worst if place == "ball.progress" else worst


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else None


def _says(place: str, settings: list[Setting], results: Results) -> bool:
    """Whether the column says anything here."""
    documents = [one for setting in settings for one in results.documents(setting)]
    if place.startswith("rings"):
        return any(figure(one, "rings.count") for one in documents)
    if place.startswith("ball"):
        return any(str(one["board"]).startswith("silicon") for one in documents)
    if place.startswith("contact"):
        return any(figure(one, place) for one in documents)
    return any(_number(figure(one, place)) is not None for one in documents)
