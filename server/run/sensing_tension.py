"""Tension over bend of the pull-release sweep, pair by pair: slopes and the calibrated line."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hardware.rod.properties import RodProperties
from robot.sensing.curvature_modes import MODES
from robot.sensing.sweep_calibration import SweepFit, free_modes
from robot.sensing.tendon_work import tendon_lengths_of_modes
from scenes.experiments.sensing import PAIRS, PEAK_PULL_N, PRETENSION_N
from server.run.sensing_run import SensingResult

DIRECTIONS = ("pulling", "releasing")
_LINE_POINTS = 20


class PairSweep(NamedTuple):
    """What was read of one pair.

    Attributes:
        words: which pair.
        bends: (n,) from the lengths of both tendons, rad.
        pulled: (n,) tension of the pulled tendon, N.
        released: (n,) of the other.
        pulling: (n,) whether on the way up.
        slides: (n,) whether both slid fully, as the calibration needs.
        lines: by direction (bends, pulled tensions) that the calibration gives.
    """

    words: str
    bends: np.ndarray
    pulled: np.ndarray
    released: np.ndarray
    pulling: np.ndarray
    slides: np.ndarray
    lines: dict[str, tuple[np.ndarray, np.ndarray]]


def pair_sweeps(result: SensingResult) -> list[PairSweep]:
    """Readings of every pair, and the lines of the calibration beside them."""
    readings, radius = result.calibrated.readings, RodProperties().pitch_radius_m
    place = np.array([stop.pair for stop in result.programme])
    pulling = np.array([stop.pulling for stop in result.programme])
    found = []
    for number, pair in enumerate(PAIRS):
        own = place == number
        lengths, tensions = readings.lengths[own], readings.tensions[own]
        bends = (lengths[:, pair.released] - lengths[:, pair.pulled]) / (2.0 * radius)
        lines = {name: _line(number, name, result.calibrated.fit) for name in DIRECTIONS}
        found.append(
            PairSweep(
                pair.words,
                bends,
                tensions[:, pair.pulled],
                tensions[:, pair.released],
                pulling[own],
                result.calibrated.used[own],
                lines,
            )
        )
    return found


def _line(number: int, direction: str, fit: SweepFit) -> tuple[np.ndarray, np.ndarray]:
    """Bends and tensions of the pulled tendon that the calibration gives for a sliding pair."""
    pair, nominal = PAIRS[number], RodProperties()
    sliding, z, lengths = np.zeros(4), np.empty(MODES), np.empty(4)
    sliding[pair.pulled] = 1.0 if direction == "pulling" else -1.0
    sliding[pair.released] = -sliding[pair.pulled]
    pulls, bends = np.linspace(0.0, PEAK_PULL_N, _LINE_POINTS), np.empty(_LINE_POINTS)
    routing = (nominal.pitch_radius_m, nominal.length_m, 0.0)
    for row, pull in enumerate(pulls):
        tensions = np.full(4, PRETENSION_N)
        tensions[pair.pulled] += pull
        free_modes(tensions, sliding, fit.stiffness, (fit.friction, fit.coulomb, 1.0), routing, z)
        tendon_lengths_of_modes(z, nominal.pitch_radius_m, 0.0, lengths)
        bends[row] = (lengths[pair.released] - lengths[pair.pulled]) / (
            2.0 * nominal.pitch_radius_m
        )
    return bends, PRETENSION_N + pulls


def frictionless_slope(stiffness: float) -> float:
    """EI / (L r), N/rad: tension difference of a pair per bend, without friction."""
    nominal = RodProperties()
    return stiffness / (nominal.length_m * nominal.pitch_radius_m)


def pair_figures(result: SensingResult) -> list[dict[str, Any]]:
    """Slope of the tension difference over the bend, and how far off the line it is, of each pair.

    Slopes are of straight lines through the stops at which both tendons slide, in the directions
    ``pulling`` and ``releasing``; ``ratio`` is beside EI/(L r) with the calibrated EI.
    """
    found = []
    whole = frictionless_slope(result.calibrated.fit.stiffness)
    for sweep in pair_sweeps(result):
        slopes, off = {}, {}
        for name in DIRECTIONS:
            own = sweep.slides & (sweep.pulling == (name == "pulling"))
            bends, difference = sweep.bends[own], (sweep.pulled - sweep.released)[own]
            slope, first = np.polyfit(bends, difference, 1)
            slopes[name] = float(slope)
            rest = difference - (first + slope * bends)
            off[name] = float(np.sqrt(np.mean(rest**2)))
        found.append(
            {
                "name": sweep.words,
                "slope_n_per_rad": slopes,
                "ratio": {name: slope / whole for name, slope in slopes.items()},
                "off_line_n": off,
                "bend_max_deg": float(np.degrees(sweep.bends.max())),
                "tension_max_n": float(sweep.pulled.max()),
            }
        )
    return found
