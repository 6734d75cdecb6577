"""What the experiments look like: paths, errors, bends, residuals, lambda."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from server.report.plots import COLOURS, Plot, band, finish, limit, title
from server.report.results import Results, Setting
from server.run.figures import desired_bend

_AXES = "xyz"
_SEEN_MM = 3.0
_LEAST_RESIDUAL = 0.1
_POINTS = 1000
_DEGREES = 180.0 / math.pi


def path_plot(results: Results, settings: Sequence[Setting], key: str) -> str:
    """Desired and true path of the tip, a row a setting, all seeds, in the planes it moves in."""
    shown = [(one, runs) for one in settings if (runs := results.traces(one))]
    if not shown:
        return ""
    desired = 1e3 * shown[0][1][0]["trace"][:, 18:21]
    extent = np.ptp(desired, axis=0)
    first, second, third = (int(axis) for axis in np.argsort(-extent, kind="stable"))
    planes = [(min(first, second), max(first, second))]
    if extent[third] > _SEEN_MM:
        planes.append((min(first, third), max(first, third)))
    one = len(shown) == 1
    rows, columns = (1, len(planes)) if one else (len(planes), len(shown))
    width = min(4.2, 11.0 / columns)
    plot = Plot(rows, columns, (width * columns, 3.3 * rows), shared=False)
    for place, (setting, runs) in enumerate(shown):
        for number, plane in enumerate(planes):
            axes = plot.axes[number if one else number * columns + place]
            _draw_path(axes, runs, *plane)
            if not one and number == 0:
                title(axes, _name(setting, settings))
    plot.legend()
    return plot.svg(key, "Desired and true path of the tip")


def _draw_path(axes: Axes, runs: Sequence[dict[str, np.ndarray]], across: int, up: int) -> None:
    """The desired path of the first run and the true ones of all, in the plane of two base axes."""
    origin = runs[0]["trace"][0, 18:21]
    for number, run in enumerate(runs):
        every = max(1, len(run["trace"]) // _POINTS)
        tip = 1e3 * (run["trace"][::every, 11:14] - origin)
        label = "true" if number == 0 else None
        axes.plot(tip[:, across], tip[:, up], color=COLOURS["true"], lw=1.0, label=label)
    asked = 1e3 * (runs[0]["trace"][:, 18:21] - origin)
    axes.plot(asked[:, across], asked[:, up], ":", color=COLOURS["desired"], label="desired")
    axes.set_aspect("equal", "datalim")
    finish(axes, f"{_AXES[up]}, mm", f"{_AXES[across]}, mm")


def _name(setting: Setting, among: Sequence[Setting]) -> str:
    """What tells a setting from the others it is shown with."""
    parts = [f"case {setting.case}"]
    if len({one.tracker for one in among}) > 1:
        parts.append(f"tracker {'on' if setting.tracker else 'off'}")
    if len({one.compensation for one in among}) > 1:
        parts = [f"compensation {setting.compensation}"]
    return ", ".join(parts)


def errors_plot(results: Results, settings: Sequence[Setting], key: str) -> str:
    """Position, orientation and RCM error over time: median and range over the seeds."""
    plot = Plot(3, 1, (11.0, 5.2))
    rows = (("position, mm", 1e3), ("orientation, °", _DEGREES), ("trocar, mm", 1e3))
    names = _style_of(settings)
    shown = False
    for setting in settings:
        runs = results.traces(setting)
        if not runs:
            continue
        shown = True
        time_s = runs[0]["trace"][:, 0]
        for place, (_, factor) in enumerate(rows):
            values = [factor * run["errors"][:, place] for run in runs]
            axes = plot.axes[place]
            band(axes, time_s, values, names[setting], _name(setting, settings))
    if not shown:
        return ""
    for axes, (words, _) in zip(plot.axes, rows, strict=True):
        finish(axes, words)
        axes.set_ylim(bottom=0.0)
    finish(plot.axes[2], rows[2][0], "time, s")
    if len(settings) > 1:
        plot.legend()
    return plot.svg(key, "Errors over time, desired minus true")


def _style_of(settings: Sequence[Setting]) -> dict[Setting, str]:
    """The line of each: by case where the cases differ, by place otherwise."""
    if len({one.case for one in settings}) == len(settings):
        return {one: one.case for one in settings}
    return {one: str(place % 3) for place, one in enumerate(settings)}


def bend_plot(results: Results, settings: Sequence[Setting], key: str) -> str:
    """Bend and direction of the segment, desired and true (the paper's Fig. 9)."""
    shown = [(one, runs) for one in settings if (runs := results.traces(one))]
    if not shown:
        return ""
    plot = Plot(2, len(shown), (min(5.0, 11.0 / len(shown)) * len(shown), 4.0))
    for column, (setting, runs) in enumerate(shown):
        bend, direction = plot.axes[column], plot.axes[len(shown) + column]
        for run in runs:
            phi, delta = 0.5 * math.pi - run["trace"][:, 8], run["trace"][:, 9]
            true = np.column_stack([phi * np.cos(delta), phi * np.sin(delta)])
            _draw_bend(bend, direction, run["trace"][:, 0], true, "true")
        wanted = desired_bend(runs[0]["detail"], runs[0]["trace"][:, 21:25])
        _draw_bend(bend, direction, runs[0]["trace"][:, 0], wanted, "desired")
        title(bend, _name(setting, settings))
        finish(bend, "θ, °" if column == 0 else "")
        finish(direction, "δ, °" if column == 0 else "", "time, s")
    return plot.svg(key, "Bend and direction of the segment, desired and true")


def _draw_bend(bend: Axes, direction: Axes, time_s: np.ndarray, uv: np.ndarray, who: str) -> None:
    size = np.linalg.norm(uv, axis=1)
    angle = (_DEGREES * np.arctan2(uv[:, 1], uv[:, 0]) + 90.0) % 360.0 - 90.0
    # A straight segment has no direction.
    angle = np.where(size > math.radians(10.0), angle, np.nan)
    line = ":" if who == "desired" else "-"
    for axes, values in ((bend, 90.0 - _DEGREES * size), (direction, angle)):
        axes.plot(time_s, values, line, color=COLOURS[who], lw=1.0)


def residual_plot(results: Results, experiments: Sequence[str], key: str) -> str:
    """What each case's levels could not do of the commanded twist (the paper's Fig. 11)."""
    plot = Plot(2, len(experiments), (5.5 * len(experiments), 4.2))
    rows = (("linear residual, mm/s", 1, 1e3), ("angular residual, °/s", 2, _DEGREES))
    for column, name in enumerate(experiments):
        for case in "012":
            runs = results.traces(Setting(name, case))
            if not runs:
                return ""
            for row, (_, place, factor) in enumerate(rows):
                values = [factor * run["detail"][:, place] for run in runs]
                axes = plot.axes[row * len(experiments) + column]
                band(axes, runs[0]["trace"][:, 0], values, case, f"case {case}")
        for row, (words, _, _) in enumerate(rows):
            axes = plot.axes[row * len(experiments) + column]
            finish(axes, words if column == 0 else "", "time, s" if row == 1 else "")
            # What is numerical noise shall not look like a residual.
            axes.set_ylim(0.0, max(axes.get_ylim()[1], _LEAST_RESIDUAL))
        title(plot.axes[column], name)
    plot.legend()
    return plot.svg(key, "Twist residuals of the three cases")


def lambda_plot(results: Results, experiments: Sequence[str], reference: float, key: str) -> str:
    """How far lambda is from its reference in each case (the paper's Fig. 12)."""
    plot = Plot(1, len(experiments), (5.5 * len(experiments), 2.6))
    for axes, name in zip(plot.axes, experiments, strict=True):
        for case in "012":
            runs = results.traces(Setting(name, case))
            if not runs:
                return ""
            values = [run["trace"][:, 10] - reference for run in runs]
            band(axes, runs[0]["trace"][:, 0], values, case, f"case {case}")
        title(axes, name)
        finish(axes, "λ − λ₀" if axes is plot.axes[0] else "", "time, s")
    plot.legend()
    return plot.svg(key, "Lambda against its reference in the three cases")


def bend_limit_plot(results: Results, bend_limit_deg: float, key: str) -> str:
    """The bend of the infeasible circle, with its limit."""
    plot = Plot(1, 1, (11.0, 2.4))
    axes = plot.axes[0]
    for case in "012":
        runs = results.traces(Setting("circle-infeasible", case))
        if not runs:
            return ""
        values = [90.0 - _DEGREES * run["trace"][:, 8] for run in runs]
        band(axes, runs[0]["trace"][:, 0], values, case, f"case {case}")
    limit(axes, bend_limit_deg, "limit")
    finish(axes, "bend, °", "time, s")
    plot.legend()
    return plot.svg(key, "Bend of the segment, with its limit")
