"""The arm stands still and the segment alone moves: first its bend, then its direction.

Source: paper, section 5.2: an arc of 5 cm in total, the bend in the first six seconds, then the
direction. The bend goes from the start's 60 degrees through straight to 60 on the other side and
half-way back; at those 30 degrees the direction turns until the tip has gone 5 cm.
"""

from __future__ import annotations

import csv
import functools
import math
from pathlib import Path as FilePath

import numpy as np

from robot.configuration import Configuration
from robot.rotations import quaternion_from_matrix
from robot.segment import tip_position, tip_rotation
from robot.start import start_bend, start_shaft_rotation
from scenes.experiments.timing import minimum_jerk, still, times

BENDING_S = 6.0
"""The bend moves until then; the direction thereafter."""
DURATION_S = 12.0
WAY_M = 0.050
"""That the tip goes in all (paper, section 5.2)."""

_ACROSS_S = 4.2
_BEND_DEG = 60.0
_SHARE_OF_LIMIT = 2.0 / 3.0
_RECORDING = FilePath(__file__).parent / "arc_stylus.csv"
_SETTLING_S = 3.0


def _largest_bend(configuration: Configuration) -> float:
    return math.radians(min(_BEND_DEG, _SHARE_OF_LIMIT * configuration.limits.bend_deg))


def _turned(uv: np.ndarray, direction: float) -> np.ndarray:
    """(n, 2) turned by the start's direction, rad."""
    cosine, sine = math.cos(direction), math.sin(direction)
    turned: np.ndarray = uv @ np.array([[cosine, sine], [-sine, cosine]])
    return turned


def _path_of(uv: np.ndarray, instants: np.ndarray, configuration: Configuration) -> np.ndarray:
    """Samples (n, 8) of the tip of a segment whose base stands where it is at the start."""
    samples = still(instants)
    shaft = start_shaft_rotation(configuration)
    length = configuration.instrument.segment_length_m
    first, place = np.empty(3), np.empty(3)
    before, turn = np.empty((3, 3)), np.empty((3, 3))
    start_u, start_v = start_bend(configuration)
    tip_position(start_u, start_v, length, first)
    tip_rotation(start_u, start_v, before)
    for row, (u, v) in zip(samples, uv, strict=True):
        tip_position(u, v, length, place)
        tip_rotation(u, v, turn)
        row[1:4] = shaft @ (place - first)
        quaternion_from_matrix(shaft @ turn @ before.T @ shaft.T, row[4:8])
    return samples


def _way(uv: np.ndarray, length: float) -> float:
    """That the tip goes along (n, 2) bends, m."""
    places = np.empty((len(uv), 3))
    for (u, v), place in zip(uv, places, strict=True):
        tip_position(u, v, length, place)
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def sweep(configuration: Configuration, instants: np.ndarray) -> np.ndarray:
    """(u, v) of the arc test.

    Args:
        configuration: where it starts, and how far the segment may bend.
        instants: (n,) s.

    Returns:
        (n, 2) rad.
    """
    u, v = start_bend(configuration)
    largest = _largest_bend(configuration)
    across = minimum_jerk(instants / _ACROSS_S)
    back = minimum_jerk((instants - _ACROSS_S) / (BENDING_S - _ACROSS_S))
    bend = math.hypot(u, v) * (1.0 - across) - largest * across + 0.5 * largest * back
    turn = _direction_sweep(configuration) * minimum_jerk(
        (instants - BENDING_S) / (DURATION_S - BENDING_S)
    )
    uv = bend[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return _turned(uv, math.radians(configuration.start.direction_deg))


def _direction_sweep(configuration: Configuration) -> float:
    """By how much the direction has to turn (rad) for the tip to go 5 cm in all."""
    largest, length = _largest_bend(configuration), configuration.instrument.segment_length_m
    start = math.hypot(*start_bend(configuration))
    bends = np.concatenate(
        [np.linspace(start, -largest, 400), np.linspace(-largest, -0.5 * largest, 100)]
    )
    left = WAY_M - _way(np.column_stack([bends, np.zeros_like(bends)]), length)
    radius = length * (1.0 - math.cos(0.5 * largest)) / (0.5 * largest)
    return min(max(left / radius, math.radians(30.0)), 2.0 * math.pi)


def arc(configuration: Configuration) -> np.ndarray:
    """The arc test by computed motion: samples (n, 8)."""
    instants = times(DURATION_S)
    return _path_of(sweep(configuration, instants), instants, configuration)


@functools.cache
def _recording() -> np.ndarray:
    """Rows (n, 3) of time in s, u and v in rad; read once."""
    with _RECORDING.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    values = np.array(rows[1:], dtype=float)
    values[:, 1:] = np.radians(values[:, 1:])
    return values


def arc_stylus(configuration: Configuration) -> np.ndarray:
    """The arc test as a stylus asked for it: samples (n, 8).

    The recording starts at 60 degrees of bend; where the configuration starts at another, the
    difference is faded out over the first three seconds.
    """
    recording = _recording()
    scale = _largest_bend(configuration) / math.radians(_BEND_DEG)
    uv = scale * recording[:, 1:]
    short = math.hypot(*start_bend(configuration)) - uv[0, 0]
    uv[:, 0] += short * (1.0 - minimum_jerk(recording[:, 0] / _SETTLING_S))
    uv[:, 1] -= uv[0, 1] * (1.0 - minimum_jerk(recording[:, 0] / _SETTLING_S))
    uv = _turned(uv, math.radians(configuration.start.direction_deg))
    return _path_of(uv, recording[:, 0], configuration)
