"""What the concentric tubes did: actuation between bounds, task scaling, translation and speed."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from robot.concentric.design import METHODS
from scenes.experiments.tubes import NEAR_INFEASIBLE
from server.report.plots import COLOURS, STYLES, Plot, finish, title
from server.report.tube_results import TubeResults, TubeTrace
from server.report.tube_tasks import LABELS, PATHS
from server.run.tube_run import PERIOD_S

MARKERS = {"nspwln": "o", "nspwln-repaired": "D", "nspqp": "s", "snsqp": "^", "hqp": "*"}
"""Of each method: colour alone says nothing in print or to the colour-blind."""
_SEEN_MM = 1e-2
_MARK_EVERY = 4
_SHOWN_ITERATIONS = 320
_LEAST_MM = 1e-4
_PLACE = {1: "tube 1, innermost", 3: "tube 3, outermost"}


def actuation_plot(results: TubeResults, path: str, start: str, arm: str, key: str) -> str:
    """Translation of each tube of an arm between its moving bounds, a row a method.

    Args:
        results: the finished runs.
        path: name of the path.
        start: name of the configuration.
        arm: ``a`` or ``b``.
        key: unique on the page.
    """
    shown = [(one, run) for one in METHODS if (run := results.trace(path, one, start))]
    if not shown:
        return ""
    tubes = shown[0][1].tubes
    plot = Plot(len(shown), tubes, (11.0, 1.65 * len(shown) + 0.7))
    for row, (method, run) in enumerate(shown):
        for tube in range(1, tubes + 1):
            axes = plot.axes[row * tubes + tube - 1]
            _draw_bounds(axes, run, f"{arm}{tube}")
            last = row == len(shown) - 1
            finish(
                axes,
                f"{LABELS[method]}\nβ, mm" if tube == 1 else "",
                "trajectory point" if last else "",
            )
            if row == 0:
                title(axes, _PLACE.get(tube, f"tube {tube}"))
    _same_heights(plot, len(shown), tubes)
    plot.legend()
    return plot.svg(key, f"Translations of robot {arm.upper()} between their bounds")


def _draw_bounds(axes: Axes, run: TubeTrace, tube: str) -> None:
    """One tube, at each point when it is left; where it was out on the way is marked."""
    left = run.at_points()
    point, beta = left.column("point"), left.column(f"beta_{tube}_mm")
    least, largest = left.column(f"least_{tube}_mm"), left.column(f"largest_{tube}_mm")
    axes.fill_between(point, least, largest, color=COLOURS["grid"], alpha=0.6, linewidth=0.0)
    axes.plot(point, largest, "--", color=COLOURS["limit"], lw=1.0, label="upper bound")
    axes.plot(point, least, ":", color=COLOURS["limit"], lw=1.3, label="lower bound")
    colour = COLOURS[f"tube-{tube[1:]}"]
    axes.plot(point, beta, color=colour, lw=1.8, label="translation β")
    out = np.unique(run.column("point")[_is_out(run, tube)])
    where = np.isin(point, out)
    words = f"out of bounds by more than {_SEEN_MM:g} mm"
    mark: dict[str, Any] = {
        "ms": 4.5,
        "mew": 1.1,
        "markevery": _MARK_EVERY,
        "color": COLOURS["ink"],
    }
    axes.plot(point[where], beta[where], "x", label=words, **mark)


def _is_out(run: TubeTrace, tube: str) -> np.ndarray:
    beta = run.column(f"beta_{tube}_mm")
    below = run.column(f"least_{tube}_mm") - beta
    above = beta - run.column(f"largest_{tube}_mm")
    return np.asarray(np.maximum(below, above) > _SEEN_MM)


def _same_heights(plot: Plot, rows: int, columns: int) -> None:
    """One scale for each tube, so that methods compare."""
    for column in range(columns):
        own = [plot.axes[row * columns + column] for row in range(rows)]
        low = min(axes.get_ylim()[0] for axes in own)
        high = max(axes.get_ylim()[1] for axes in own)
        for axes in own:
            axes.set_ylim(low, high)


_LINES = {"nspqp": STYLES["1"], "snsqp": STYLES["2"], "hqp": STYLES["0"]}


def scaling_plot(results: TubeResults, key: str) -> str:
    """Points reached, relative error and task scale over the iterations, a column a start."""
    starts = [one["configuration"] for one in results.documents(NEAR_INFEASIBLE, "snsqp")]
    if not starts:
        return ""
    plot = Plot(3, len(starts), (11.0, 6.0))
    for column, start in enumerate(starts):
        reached, error, scale = (plot.axes[row * len(starts) + column] for row in range(3))
        for method, line in _LINES.items():
            run = results.trace(NEAR_INFEASIBLE, method, start)
            if run is None:
                continue
            _draw_scaling((reached, error, scale), run, method, line)
        title(reached, f"configuration {start}")
        first = column == 0
        finish(reached, "point under way" if first else "")
        finish(error, "‖ε_AB‖, mm" if first else "")
        finish(scale, "task scales" if first else "", "iteration")
        error.set_yscale("log")
        error.set_ylim(_LEAST_MM, 300.0)
        scale.set_ylim(-0.05, 1.1)
        reached.set_xlim(0, _SHOWN_ITERATIONS)
    plot.legend()
    return plot.svg(key, "Points, relative error and task scale near an infeasible task")


def _draw_scaling(rows: tuple[Axes, Axes, Axes], run: TubeTrace, method: str, line: Any) -> None:
    iteration = np.arange(1, len(run.column("point")) + 1)
    error = np.maximum(run.column("relative_error_mm"), _LEAST_MM)
    columns = [(rows[0], run.column("point"), line), (rows[1], error, line)]
    if method == "snsqp":
        columns.append((rows[2], run.column("scale_relative"), line))
        columns.append((rows[2], run.column("scale_tracking"), "-"))
    for axes, values, own in columns:
        axes.plot(
            iteration[:_SHOWN_ITERATIONS],
            values[:_SHOWN_ITERATIONS],
            color=COLOURS[f"method-{method}"],
            linestyle=own,
            linewidth=0.8 if own == "-" and axes is rows[2] else 1.4,
            label=LABELS[method],
        )
    rows[0].plot(
        *([iteration[-1]], [run.column("point")[-1]]), MARKERS[method],
        color=COLOURS[f"method-{method}"], ms=6.0,
    )  # fmt: skip


def trade_off_plot(results: TubeResults, speed_mm_s: float, key: str) -> str:
    """Total translation of all tubes against their peak and mean speed, a point a start."""
    plot = Plot(2, len(PATHS), (11.0, 5.4), shared=False)
    drawn = False
    for column, path in enumerate(PATHS):
        peak, mean = plot.axes[column], plot.axes[len(PATHS) + column]
        for method in METHODS:
            runs = results.documents(path, method)
            if not runs:
                continue
            drawn = True
            total = np.array([one["translation_total_mm"] for one in runs])
            peaks = [one["peak_translation_mm_s"] for one in runs]
            ways = [2 * len(one["translation_mm"]["a"]) * one["iterations"] for one in runs]
            means = total / (np.array(ways) * PERIOD_S)
            for axes, values in ((peak, peaks), (mean, means)):
                axes.plot(
                    *(total, values), MARKERS[method], color=COLOURS[f"method-{method}"],
                    ms=8.0 if method == "hqp" else 6.0, label=LABELS[method], alpha=0.9,
                )  # fmt: skip
        peak.axhline(speed_mm_s, color=COLOURS["limit"], linestyle="--", linewidth=1.0)
        peak.annotate(
            *("V_max", (0.0, speed_mm_s)), xycoords=("axes fraction", "data"), xytext=(4, 3),
            textcoords="offset points", color=COLOURS["limit"], fontsize=8.0,
        )  # fmt: skip
        title(peak, path)
        first = column == 0
        finish(peak, "peak speed of a tube, mm/s" if first else "")
        finish(mean, "mean speed of a tube, mm/s" if first else "", "translation of all tubes, mm")
        for axes in (peak, mean):
            axes.set_ylim(bottom=0.0)
            axes.set_xlim(left=0.0)
    if not drawn:
        return ""
    plot.legend()
    return plot.svg(key, "Translation of the tubes against their speed")
