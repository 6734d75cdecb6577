"""Gain, offset and friction of the tendons from a free bending sweep. Least squares, offline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot.compensation import friction_after
from robot.errors import KeyholeError

STICKS_RAD = np.geomspace(0.004, 0.4, 25)
"""Ways over which friction may turn around; the best of them is taken."""
FEWEST_SAMPLES = 50


class SweepTooPoor(KeyholeError):
    """The sweep does not show what a calibration needs."""

    code = "sweep_too_poor"


class AxisFit(NamedTuple):
    """bend = offset + gain * told - friction * f; rad.

    Attributes:
        gain: bend over told bend.
        offset: rad.
        friction: rad.
        stick: rad.
        residual: rms of what is left over, rad.
    """

    gain: float
    offset: float
    friction: float
    stick: float
    residual: float


def bend_of(axis: np.ndarray) -> np.ndarray:
    """(u, v) (n, 2) of tip axes (n, 3) in the segment's base frame; straight is (0, 0, 1)."""
    across = np.hypot(axis[:, 0], axis[:, 1])
    scale = np.arctan2(across, axis[:, 2]) / np.maximum(across, 1e-12)
    return np.column_stack([scale * axis[:, 0], -scale * axis[:, 1]])


def _friction(bend: np.ndarray, stick: float) -> np.ndarray:
    """Share of full friction along a history of bends (n,)."""
    shares = np.zeros(len(bend))
    for k in range(1, len(bend)):
        shares[k] = friction_after(shares[k - 1], bend[k] - bend[k - 1], stick)
    return shares


def fit_axis(told: np.ndarray, seen_at: np.ndarray, seen: np.ndarray) -> AxisFit:
    """Fit one coordinate.

    Args:
        told: (n,) what the servos stood at, as bend, every tick, rad.
        seen_at: (m,) at which of these ticks the tip was seen.
        seen: (m,) the bend seen then, rad.

    Raises:
        SweepTooPoor: too few samples, or too little motion.
    """
    if len(seen) < FEWEST_SAMPLES or np.ptp(told) < 0.5:
        raise SweepTooPoor(
            f"{len(seen)} samples over {np.degrees(np.ptp(told)):.0f} deg of bend; at least "
            f"{FEWEST_SAMPLES} over 29 deg are needed: check the tracker and that the servos move"
        )
    best: AxisFit | None = None
    for stick in STICKS_RAD:
        shares = _friction(told, float(stick))[seen_at]
        terms = np.column_stack([np.ones(len(seen)), told[seen_at], -shares])
        solution = np.linalg.lstsq(terms, seen, rcond=None)[0]
        left = float(np.sqrt(np.mean((terms @ solution - seen) ** 2)))
        if best is None or left < best.residual:
            offset, gain, friction = (float(value) for value in solution)
            best = AxisFit(gain, offset, max(friction, 0.0), float(stick), left)
    assert best is not None
    return best
