"""Gain, offset and friction of the tendons from a free bending sweep. Least squares, offline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot.compensation import friction_after, held_back, tendon_motion
from robot.errors import KeyholeError

STICKS_RAD = np.geomspace(0.005, 0.3, 20)
"""Ways over which friction may turn around; the best of them is taken."""
FEWEST_SAMPLES = 50
LEAST_MOTION_DEG = 30.0


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


def _held_back(bends: np.ndarray, stick: float, chord: float) -> np.ndarray:
    """Shares (n, 2) of full friction that hold u and v back along a history of bends (n, 2)."""
    shares, slid, friction = np.zeros_like(bends), np.empty(4), np.zeros(4)
    for k in range(1, len(bends)):
        (u_before, v_before), (u, v) = bends[k - 1], bends[k]
        tendon_motion(u_before, v_before, u, v, chord, slid)
        for i in range(4):
            friction[i] = friction_after(friction[i], slid[i], stick)
        held_back(friction, shares[k])
    return shares


def fit(told: np.ndarray, seen_at: np.ndarray, seen: np.ndarray, chord: float) -> list[AxisFit]:
    """Fit both coordinates.

    Args:
        told: (n, 2) what the servos stood at, as bend (u, v), every tick, rad.
        seen_at: (m,) at which of these ticks the tip was seen.
        seen: (m, 2) the bend seen then, rad.
        chord: see :func:`robot.compensation.tendon_motion`.

    Returns:
        The fits of u and of v.

    Raises:
        SweepTooPoor: too few samples, or too little motion.
    """
    least = float(np.degrees(np.ptp(told, axis=0).min()))
    if len(seen) < FEWEST_SAMPLES or least < LEAST_MOTION_DEG:
        raise SweepTooPoor(
            f"{len(seen)} samples over {least:.0f} deg of bend; at least {FEWEST_SAMPLES} over "
            f"{LEAST_MOTION_DEG:.0f} deg are needed: check the tracker and that the servos move"
        )
    best: list[AxisFit] = []
    for stick in STICKS_RAD:
        shares = _held_back(told, float(stick), chord)[seen_at]
        fits = [_axis(told[seen_at, k], shares[:, k], seen[:, k], float(stick)) for k in range(2)]
        best = best or fits
        best = [min(pair, key=lambda one: one.residual) for pair in zip(best, fits, strict=True)]
    return best


def _axis(told: np.ndarray, share: np.ndarray, seen: np.ndarray, stick: float) -> AxisFit:
    terms = np.column_stack([np.ones(len(seen)), told, -share])
    solution = np.linalg.lstsq(terms, seen, rcond=None)[0]
    left = float(np.sqrt(np.mean((terms @ solution - seen) ** 2)))
    offset, gain, friction = (float(value) for value in solution)
    return AxisFit(gain, offset, max(friction, 0.0), stick, left)
