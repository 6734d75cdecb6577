"""Plots as SVG that stands in the page: its colours are the page's, light and dark."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLOURS = {
    "ink": "#010101",
    "muted": "#010102",
    "grid": "#010103",
    "limit": "#010104",
    "desired": "#010105",
    "true": "#010106",
    "case-0": "#010107",
    "case-1": "#010108",
    "case-2": "#010109",
    **{f"tube-{number}": f"#01011{number}" for number in range(1, 7)},
    "method-nspwln": "#010121",
    "method-nspwln-repaired": "#010122",
    "method-nspqp": "#010123",
    "method-snsqp": "#010124",
    "method-hqp": "#010125",
    "sensing-ours": "#010131",
    "sensing-told": "#010132",
    "sensing-polynomial": "#010133",
    "sensing-constant": "#010134",
    "sensing-printed": "#010135",
}
"""Stand-ins for the page's colours: matplotlib knows no CSS variables, the page fills them in."""

STYLES = {"0": "-", "1": (0, (6, 2)), "2": (0, (1.5, 1.5))}
"""Line of each case: colour alone says nothing in print or to the colour-blind."""

_PIXELS_A_POINT = 4.0 / 3.0
_POINTS = 500
"""Of a line over time: more cannot be seen."""

_SETTINGS: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "keyhole",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.linewidth": 0.8,
    "axes.edgecolor": COLOURS["muted"],
    "axes.labelcolor": COLOURS["ink"],
    "axes.grid": True,
    "grid.color": COLOURS["grid"],
    "grid.linewidth": 0.8,
    "text.color": COLOURS["ink"],
    "xtick.color": COLOURS["muted"],
    "ytick.color": COLOURS["muted"],
    "lines.linewidth": 1.4,
    "path.simplify_threshold": 0.3,
}


class Plot:
    """A figure of rows and columns of axes.

    Args:
        rows: how many below each other, sharing their time axis if ``shared``.
        columns: how many side by side.
        size: width and height in inches; the page scales it.
        shared: whether a column's axes share the horizontal axis.
    """

    def __init__(
        self, rows: int, columns: int, size: tuple[float, float], shared: bool = True
    ) -> None:
        with matplotlib.rc_context(_SETTINGS):
            self._figure = Figure(figsize=size, layout="constrained")
            self.axes: list[Axes] = list(
                self._figure.subplots(
                    rows, columns, sharex="col" if shared else "none", squeeze=False
                ).flat
            )

    def legend(self, *others: int) -> None:
        """Names of the first axes' lines, above all on the right, where they hide nothing.

        Args:
            others: places of axes whose lines are named too.
        """
        lines, names = self.axes[0].get_legend_handles_labels()
        for place in others:
            more, words = self.axes[place].get_legend_handles_labels()
            lines, names = [*lines, *more], [*names, *words]
        self._figure.legend(
            lines,
            names,
            loc="outside upper right",
            ncols=len(names),
            frameon=False,
            labelcolor=COLOURS["ink"],
        )

    def svg(self, key: str, title: str) -> str:
        """The figure as an ``<svg>`` element.

        Args:
            key: unique on the page; it goes before every id.
            title: what it shows, for those who do not see it.
        """
        file = io.StringIO()
        with matplotlib.rc_context(_SETTINGS):
            nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
            self._figure.savefig(file, format="svg", transparent=True, metadata=nothing)
        return _inlined(file.getvalue(), key, title)


def _inlined(text: str, key: str, title: str) -> str:
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    head, rest = text.split(">", 1)
    box = re.search(r'viewBox="[^"]+"', head)
    assert box is not None
    rest = re.sub(r"(\d\.\d\d)\d+", r"\1", rest)
    rest = re.sub(r'id="([^"]+)"', rf'id="{key}-\1"', rest)
    rest = re.sub(r'xlink:href="#([^"]+)"', rf'href="#{key}-\1"', rest)
    rest = re.sub(r"url\(#([^)]+)\)", rf"url(#{key}-\1)", rest)
    rest = re.sub(r"font(-family)?: ([\d.]+px )?'[^;\"]*", r"font-size: \2", rest)
    for name, colour in COLOURS.items():
        rest = rest.replace(colour, f"var(--{name})")
    # Ids of axes and lines are not referred to; without them the page is a third smaller.
    used = set(re.findall(rf"#({re.escape(key)}-[\w-]+)", rest))
    rest = re.sub(r' id="([^"]+)"', lambda found: found[0] if found[1] in used else "", rest)
    width = round(float(box[0].split()[2]) * _PIXELS_A_POINT)
    return (
        f'<svg {box[0]} style="max-width: {width}px" role="img" aria-label="{title}">{rest.strip()}'
    )


def finish(axes: Axes, vertical: str, horizontal: str = "") -> None:
    """Label the axes, with the units in the labels."""
    axes.set_ylabel(vertical)
    if horizontal:
        axes.set_xlabel(horizontal)
    axes.spines[["top", "right"]].set_visible(False)


def title(axes: Axes, words: str) -> None:
    """A title above the axes on the left."""
    axes.set_title(words, loc="left", fontsize=9.0, color=COLOURS["ink"])


def band(axes: Axes, time_s: np.ndarray, runs: Sequence[np.ndarray], case: str, name: str) -> None:
    """The median over the runs as a line, smallest to largest as a band.

    Where there are more samples than can be seen, the largest of each few stands for them.

    Args:
        axes: where.
        time_s: (n,) s.
        runs: (n_i,) values of each run; they are cut to the shortest.
        case: name of the case, for colour and line.
        name: in the legend.
    """
    shortest = min(len(run) for run in runs)
    block = max(1, math.ceil(shortest / _POINTS))
    count = shortest // block
    # A block of samples becomes one point; the band keeps the largest and smallest of each.
    values = np.array([run[: count * block].reshape(count, block) for run in runs])
    colour = COLOURS[f"case-{case}"]
    time_s = time_s[: count * block : block]
    if len(runs) > 1:
        low, high = values.min(axis=(0, 2)), values.max(axis=(0, 2))
        axes.fill_between(time_s, low, high, color=colour, alpha=0.18, linewidth=0.0)
    middle = np.median(values.max(axis=2), axis=0)
    axes.plot(time_s, middle, color=colour, linestyle=STYLES[case], label=name)


def limit(axes: Axes, value: float, words: str) -> None:
    """A dashed line with words at ``value``."""
    axes.axhline(value, color=COLOURS["limit"], linestyle="--", linewidth=1.0)
    axes.annotate(
        words,
        (1.0, value),
        xycoords=("axes fraction", "data"),
        xytext=(-2, 2),
        textcoords="offset points",
        ha="right",
        color=COLOURS["limit"],
        fontsize=8.0,
    )
