"""The figures of several runs in one table: to print, and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

Figure = str | float | int | bool | None

COLUMNS: tuple[tuple[str, str], ...] = (
    ("experiment", "experiment"),
    ("case", "case"),
    ("plant", "plant"),
    ("preset", "preset"),
    ("seed", "seed"),
    ("tracker", "tracker"),
    ("compensation", "compensation"),
    ("ended", "ended"),
    ("position_max_mm", "errors.position_mm.max"),
    ("position_rms_mm", "errors.position_mm.rms"),
    ("orientation_max_deg", "errors.orientation_deg.max"),
    ("orientation_rms_deg", "errors.orientation_deg.rms"),
    ("rcm_max_mm", "errors.rcm_mm.max"),
    ("bend_max_deg", "bend.theta_deg.max"),
    ("direction_max_deg", "bend.direction_deg.max"),
    ("lambda_max_error", "lambda.max_abs_error"),
    ("contact_max_n", "contact.max_force_n"),
    ("rings_passed", "rings.passed"),
    ("rings_touched", "rings.touched"),
    ("rings", "rings.count"),
    ("ball_progress", "ball.progress"),
    ("realtime_factor", "realtime_factor"),
)
"""Name of the column, and where its figure stands in a run's document."""

_PRINTED = (
    ("experiment", 18, ""),
    ("case", 9, ""),
    ("seed", 5, ""),
    ("position_max_mm", 9, ".3f"),
    ("orientation_max_deg", 9, ".3f"),
    ("rcm_max_mm", 9, ".3f"),
    ("realtime_factor", 9, ".1f"),
)
_HEADS = ("experiment", "case", "seed", "pos mm", "ori deg", "rcm mm", "x real")


def figure(document: dict[str, Any], place: str) -> Figure:
    """The value at a dotted place of a run's document, None where there is none."""
    value: Any = document
    for key in place.split("."):
        if not isinstance(value, dict) or key not in value:
            return None
        value = value[key]
    found: Figure = value
    return found


def csv_text(documents: Iterable[dict[str, Any]]) -> str:
    """A CSV with a row a run and the columns ``COLUMNS``."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([name for name, _ in COLUMNS])
    for document in documents:
        row = [figure(document, place) for _, place in COLUMNS]
        writer.writerow(["" if value is None else value for value in row])
    return text.getvalue()


def printed(documents: Sequence[dict[str, Any]]) -> str:
    """A table for the terminal: the largest errors, what became of rings and ball, how it ended."""
    places = dict(COLUMNS)
    head = "".join(
        f"{title:<{width}}" if not form else f"{title:>{width}}"
        for title, (_, width, form) in zip(_HEADS, _PRINTED, strict=True)
    )
    lines = [f"{head}  ended"]
    for document in documents:
        cells = []
        for name, width, form in _PRINTED:
            value = figure(document, places[name])
            if not form:
                cells.append(f"{value!s:<{width}}")
            else:
                cells.append(f"{'-' if value is None else format(value, form):>{width}}")
        lines.append(f"{''.join(cells)}  {document['ended']}{_remarks(document)}")
    return "\n".join(lines)


def _remarks(document: dict[str, Any]) -> str:
    words = []
    if figure(document, "rings.count"):
        words.append(f"{document['rings']['passed']} of {document['rings']['count']} rings")
    if str(document.get("board", "")).startswith("silicon"):
        words.append(f"ball at {100 * document['ball']['progress']:.0f} %")
    if figure(document, "bend.theta_deg.max") is not None:
        bend = document["bend"]
        words.append(
            f"bend {bend['theta_deg']['max']:.2f} deg, "
            f"direction {bend['direction_deg']['max'] or 0.0:.2f} deg"
        )
    return f" ({', '.join(words)})" if words else ""
