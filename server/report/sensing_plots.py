"""What shape and force sensing looks like: tensions, shapes, errors along the segment, forces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from scenes.experiments.chirp import frequency
from scenes.experiments.sensing import (
    CHIRP,
    FORCE_LEVELS,
    LEVEL_PULLS_N,
    PAIRS,
    PULL_RELEASE,
    Bend,
)
from server.report.plots import COLOURS, Plot, finish, title
from server.report.sensing_results import SensingResults
from server.run.sensing_chirp import CURVES, WINDOWS
from server.run.sensing_tension import DIRECTIONS

_AZIMUTH, _ELEVATION = math.radians(-60.0), math.radians(22.0)
_AXIS_MM = 9.0


class Look(NamedTuple):
    """How a method is drawn: colour alone says nothing in print or to the colour-blind.

    Attributes:
        words: in the legend.
        colour: its name.
        line: style.
        marker: of its points.
    """

    words: str
    colour: str
    line: Any
    marker: str


LOOKS = {
    "ours": Look("ours", "sensing-ours", "-", "o"),
    "ours_no_contact": Look("ours, told of no contact", "sensing-told", (0, (8, 2)), "D"),
    "ours_axis_known": Look("ours, axis known", "sensing-told", (0, (8, 2)), "D"),
    "ours_axis_free": Look("ours, axis free", "sensing-ours", "-", "o"),
    "polynomial": Look("polynomial curvature (paper)", "sensing-polynomial", (0, (4, 2)), "s"),
    "polynomial_axis_known": Look("polynomial, axis known", "sensing-polynomial", "--", "s"),
    "polynomial_equation_43": Look("polynomial, eq. (43)", "sensing-printed", ":", "v"),
    "constant": Look("constant curvature", "sensing-constant", (0, (1.5, 1.5)), "^"),
    "constant_axis_known": Look("constant, axis known", "sensing-constant", ":", "^"),
}
FREE_METHODS = ("constant", "polynomial", "ours", "ours_no_contact")
CONTACT_METHODS = ("constant", "polynomial", "ours", "ours_axis_known")
FORCES = (
    *("polynomial_equation_43", "constant_axis_known", "polynomial_axis_known"),
    *("ours_axis_free", "ours_axis_known"),
)


def shape_plot(
    arrays: dict[str, np.ndarray] | None,
    case: int,
    bend: Bend,
    methods: Sequence[str],
    key: str,
) -> str:
    """Shapes in the bending plane and in space, and errors along the segment.

    Args:
        arrays: of the run (see :func:`server.run.sensing_traces.sensing_arrays`).
        case: which bend or level of it.
        bend: where its plane is.
        methods: which to show.
        key: unique on the page.
    """
    if arrays is None or f"case{case}.true" not in arrays:
        return ""
    plot = Plot(1, 4, (11.4, 3.3), shared=False)
    plane, space, off, turned = plot.axes
    true = 1e3 * arrays[f"case{case}.true"]
    delta = math.radians(bend.delta_deg)
    lean = np.array([math.cos(delta), -math.sin(delta), 0.0])
    wide: dict[str, Any] = {"color": COLOURS["true"], "lw": 3.0, "alpha": 0.55}
    plane.plot(true @ lean, true[:, 2], label="true", **wide)
    _draw_frame(space, true)
    space.plot(*_projected(true), **wide)
    fractions = arrays[f"case{case}.fractions"]
    for method in methods:
        look = LOOKS[method]
        style = {"color": COLOURS[look.colour], "linestyle": look.line, "lw": 1.4}
        shape = 1e3 * arrays[f"case{case}.shape.{method}"]
        plane.plot(shape @ lean, shape[:, 2], label=look.words, **style)
        space.plot(*_projected(shape), **style)
        off.plot(fractions, 1e3 * arrays[f"case{case}.off.{method}"], **style)
        turned.plot(fractions, np.degrees(arrays[f"case{case}.turned.{method}"]), **style)
    plane.set_aspect("equal", "datalim")
    space.set_aspect("equal", "datalim")
    space.set_axis_off()
    finish(plane, "z, mm", "toward the bend, mm")
    finish(off, "position error, rms, mm", "s")
    finish(turned, "angle error, rms, °", "s")
    for axes, words in zip(plot.axes, ("(a) in plane", "(b) in space", "(c)", "(c)"), strict=True):
        title(axes, words)
    for axes in (off, turned):
        axes.set_ylim(bottom=0.0)
        axes.set_xlim(0.0, 1.0)
    plot.legend()
    return plot.svg(key, f"Shapes and their errors along the segment at {bend.words()}")


def _projected(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) as seen from the side and from above."""
    x, y, z = np.atleast_2d(points).T
    across = -math.sin(_AZIMUTH) * x + math.cos(_AZIMUTH) * y
    ahead = math.cos(_AZIMUTH) * x + math.sin(_AZIMUTH) * y
    return across, math.cos(_ELEVATION) * z - math.sin(_ELEVATION) * ahead


def _draw_frame(axes: Axes, true: np.ndarray) -> None:
    """The base frame's axes, and the shadow of the backbone on the base's plane."""
    for place, name in enumerate("xyz"):
        end = _AXIS_MM * np.eye(3)[place]
        across, up = _projected(np.array([np.zeros(3), end]))
        axes.plot(across, up, color=COLOURS["muted"], lw=0.8)
        axes.annotate(name, (across[1], up[1]), color=COLOURS["muted"], fontsize=8.0)
    shadow = true * np.array([1.0, 1.0, 0.0])
    axes.plot(*_projected(shadow), color=COLOURS["grid"], lw=2.0)


def chirp_plot(results: SensingResults, key: str) -> str:
    """Position and torque of a module in three parts of a chirp (the paper's Fig. 6)."""
    arrays = results.arrays(CHIRP)
    if arrays is None:
        return ""
    count = len(WINDOWS)
    plot = Plot(2, count, (11.4, 5.2))
    for place in range(count):
        position, torque = plot.axes[place], plot.axes[count + place]
        own = {name: arrays[f"window{place}.{name}"] for name in ("time_s", *CURVES)}
        for axes, name, factor, words, colour, line in (
            (position, "angle_rad", 1e3, "pulley", "sensing-constant", "-"),
            (position, "encoder_rad", 1e3, "motor’s encoder", "sensing-told", "-"),
            (position, "commanded_rad", 1e3, "commanded", "ink", ":"),
            (torque, "current_nm", 1e3, "from the current", "sensing-printed", "-"),
            (torque, "cell_nm", 1e3, "torque cell", "sensing-polynomial", "-"),
            (torque, "load_nm", 1e3, "true", "true", "-"),
        ):
            style: dict[str, Any] = {"color": COLOURS[colour], "linestyle": line, "label": words}
            style["lw"] = 0.7 if name == "current_nm" else 1.2
            axes.plot(own["time_s"], factor * own[name], **style)
        low, high = (frequency(own["time_s"][[0, -1]])).tolist()
        title(position, f"{low:.2g} to {high:.2g} Hz")
        first = place == 0
        finish(position, "angle, mrad" if first else "")
        finish(torque, "torque, mN m" if first else "", "time, s")
    plot.legend(count)
    return plot.svg(key, "Position and torque of one module during a chirp")


def tension_plot(results: SensingResults, key: str) -> str:
    """Tensions of the four pairs: stop by stop, and over the bend (the paper's Fig. 7)."""
    arrays = results.arrays(PULL_RELEASE)
    if arrays is None:
        return ""
    plot = Plot(2, len(PAIRS), (11.4, 5.2), shared=False)
    for place, pair in enumerate(PAIRS):
        stops, bends = plot.axes[place], plot.axes[len(PAIRS) + place]
        own = {name: arrays[f"pair{place}.{name}"] for name in ("bends", "pulled", "released")}
        number = np.arange(1, len(own["bends"]) + 1)
        pulled, released = COLOURS["sensing-ours"], COLOURS["sensing-polynomial"]
        stops.plot(number, own["pulled"], "o-", ms=3.0, lw=0.9, color=pulled, label="pulled")
        stops.plot(number, own["released"], "s-", ms=3.0, lw=0.9, color=released, label="released")
        pulling = arrays[f"pair{place}.pulling"] > 0.0
        slides = arrays[f"pair{place}.slides"] > 0.0
        degrees = np.degrees(own["bends"])
        for name, chosen, mark in (("pulling", pulling, "^"), ("releasing", ~pulling, "v")):
            line = arrays[f"pair{place}.line.{name}"]
            colour = COLOURS["sensing-told"] if name == DIRECTIONS[0] else COLOURS["limit"]
            bends.plot(np.degrees(line[0]), line[1], color=colour, lw=1.0)
            for which, face in ((chosen & slides, colour), (chosen & ~slides, "none")):
                bends.plot(
                    *(degrees[which], own["pulled"][which], mark), ms=4.0, color=colour, mfc=face
                )
        first = place == 0
        title(stops, f"({'abcd'[place]}) {pair.words}")
        finish(stops, "tension, N" if first else "", "stop")
        finish(bends, "tension of the pulled tendon, N" if first else "", "bend, °")
        for axes in (stops, bends):
            axes.set_ylim(bottom=0.0)
    plot.legend()
    return plot.svg(key, "Tension of four pairs of tendons, pulled and released")


def force_plot(results: SensingResults, noise: tuple[float, float], key: str) -> str:
    """Forces of the five levels, with what one sample scatters (the paper's Fig. 12)."""
    documents = results.documents(FORCE_LEVELS, noise)
    if not documents:
        return ""
    levels = documents[0]["levels"]
    plot = Plot(1, 2, (11.4, 3.9), shared=False)
    forces, errors = plot.axes
    pulls = np.array(LEVEL_PULLS_N)
    true = np.array([level["true_n"] for level in levels])
    forces.plot(pulls, true, color=COLOURS["true"], lw=3.0, alpha=0.55, label="true")
    errors.axhline(0.0, color=COLOURS["true"], lw=3.0, alpha=0.55)
    spaced = np.linspace(-0.11, 0.11, len(FORCES))
    for place, name in enumerate(FORCES):
        look = LOOKS[name]
        mean = np.array([level["force_n"][name]["mean"] for level in levels])
        std = np.array([level["force_n"][name]["std"] for level in levels])
        style: dict[str, Any] = {
            "color": COLOURS[look.colour],
            "marker": look.marker,
            "linestyle": "none",
            "ms": 4.5,
            "capsize": 2.5,
            "elinewidth": 1.1,
        }
        forces.errorbar(pulls + spaced[place], mean, std, label=look.words, **style)
        errors.errorbar(pulls + spaced[place], 1e3 * (mean - true), 1e3 * std, **style)
    finish(forces, "force on the platform, N", "pull beyond touching, N")
    finish(errors, "estimated − true, mN", "pull beyond touching, N")
    plot.legend()
    return plot.svg(key, "Forces of five levels, true and estimated")
