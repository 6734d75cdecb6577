"""Gain, offset and friction of the tendons from a free bending sweep. Least squares, offline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from robot.compensation import friction_after, held_back, tendon_motion
from robot.compiled import compiled
from robot.errors import KeyholeError

FEWEST_SAMPLES = 50
LEAST_MOTION_DEG = 30.0
_NEWTON_STEPS = 6
_FIRST = np.array([[0.95, 0.95], [0.0, 0.0], [0.02, 0.02], [0.03, 0.03]])
_LOWEST = np.array([[0.3, 0.3], [-0.4, -0.4], [0.0, 0.0], [0.005, 0.005]])
_HIGHEST = np.array([[1.4, 1.4], [0.4, 0.4], [0.4, 0.4], [0.5, 0.5]])
"""Gain, offset, friction and stick of u and v: where the fit starts and what it may not leave."""


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


@compiled
def _predict(
    told: np.ndarray,
    gain: np.ndarray,
    offset: np.ndarray,
    friction: np.ndarray,
    stick: np.ndarray,
    chord: float,
    out: np.ndarray,
) -> None:
    """Bends (n, 2) that the servos' history ``told`` (n, 2) gives.

    The friction depends on the bend and the bend on the friction; Newton's steps solve for both,
    tick by tick.
    """
    shares, slid = np.empty(2), np.empty(4)
    before, trial = np.zeros(4), np.zeros(4)
    bend, last = np.zeros(2), np.zeros(2)
    for k in range(2):
        last[k] = offset[k] + gain[k] * told[0, k]
    for row in range(told.shape[0]):
        bend[:] = last
        for _ in range(_NEWTON_STEPS):
            tendon_motion(last[0], last[1], bend[0], bend[1], chord, slid)
            for i in range(4):
                trial[i] = friction_after(before[i], slid[i], stick[i % 2])
            held_back(trial, shares)
            for k in range(2):
                free = 0
                for i in range(k, 4, 2):
                    free += 1 if abs(trial[i]) < 1.0 else 0
                slope = 1.0 + 0.5 * free * friction[k] / stick[k]
                off = bend[k] - offset[k] - gain[k] * told[row, k] + friction[k] * shares[k]
                bend[k] -= off / slope
        tendon_motion(last[0], last[1], bend[0], bend[1], chord, slid)
        for i in range(4):
            before[i] = friction_after(before[i], slid[i], stick[i % 2])
        last[:] = bend
        out[row] = bend


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
    predicted = np.empty_like(told)

    def left(values: np.ndarray) -> np.ndarray:
        gain, offset, friction, stick = values.reshape(4, 2)
        _predict(told, gain, offset, friction, stick, chord, predicted)
        return np.asarray((predicted[seen_at] - seen).T.ravel())

    found = least_squares(left, _FIRST.ravel(), bounds=(_LOWEST.ravel(), _HIGHEST.ravel()))
    gain, offset, friction, stick = found.x.reshape(4, 2).tolist()
    rest = np.sqrt(np.mean(left(found.x).reshape(2, -1) ** 2, axis=1)).tolist()
    return [AxisFit(gain[k], offset[k], friction[k], stick[k], rest[k]) for k in range(2)]


def sliding_shares(told: np.ndarray, fits: list[AxisFit], chord: float) -> np.ndarray:
    """How the tendons slid in a sweep, as the fits have it: (n, 4), 1 toward the pulley.

    Args:
        told: (n, 2) as in :func:`fit`.
        fits: of u and of v.
        chord: as in :func:`fit`.
    """
    gain, offset, friction, stick = np.array([fit[:4] for fit in fits]).T.copy()
    bends, shares = np.empty_like(told), np.zeros((len(told), 4))
    _predict(told, gain, offset, friction, stick, chord, bends)
    slid, share = np.empty(4), np.zeros(4)
    for row in range(1, len(told)):
        (u_before, v_before), (u, v) = bends[row - 1], bends[row]
        tendon_motion(u_before, v_before, u, v, chord, slid)
        for i in range(4):
            share[i] = friction_after(share[i], slid[i], fits[i % 2].stick)
        shares[row] = -share
    return shares
