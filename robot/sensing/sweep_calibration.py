"""Bending stiffness and tendon friction from a free pull-release sweep. Least squares, offline.

Nothing touches the tip while tendons are pulled and released. Then the balance of virtual work
gives the bend of every sample from its tensions alone; stiffness, capstan coefficient and Coulomb
part are those whose bends fit the tendon lengths best. Pulling and releasing tell friction from
stiffness, small and large bends tell capstan from Coulomb.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from robot.compiled import compiled
from robot.errors import KeyholeError
from robot.sensing.curvature_modes import MODES, ORDERS
from robot.sensing.tendon_work import tendon_forces, tendon_lengths_of_modes

FEWEST_SAMPLES = 40
LEAST_BEND_DEG = 20.0
_STEPS = 60
_TAUT_N = 0.05
_SETTLED_RAD = 1e-10
_FAR = 10.0
_FLOOR = 0.002
"""A relative standard deviation below this is not believed: the model itself is no better."""


class SweepUnusable(KeyholeError):
    """The sweep does not show stiffness and friction.

    Attributes:
        samples: how many there were.
        bend_deg: largest bend that the tendon lengths show.
    """

    code = "sweep_unusable"

    def __init__(self, samples: int, bend_deg: float, what: str) -> None:
        super().__init__(
            f"the pull-release sweep cannot be used: {what} ({samples} samples, bends up to "
            f"{bend_deg:.0f} deg); pull and release by at least {LEAST_BEND_DEG:.0f} deg, free of "
            f"contact, with {FEWEST_SAMPLES} samples or more"
        )
        self.samples, self.bend_deg = samples, bend_deg


class SweepFit(NamedTuple):
    """What a sweep shows.

    Attributes:
        stiffness: EI, N m^2.
        stiffness_deviation: relative standard deviation.
        friction: capstan coefficient mu.
        coulomb: Coulomb part c, N.
        friction_deviation: relative standard deviation of the friction as a whole.
        residual: rms of the tendon lengths, m.
    """

    stiffness: float
    stiffness_deviation: float
    friction: float
    coulomb: float
    friction_deviation: float
    residual: float


@compiled
def free_modes(
    tensions: np.ndarray,
    sliding: np.ndarray,
    stiffness: float,
    friction: tuple[float, float, float],
    routing: tuple[float, float, float],
    z: np.ndarray,
) -> bool:
    """Modes (11,) of a segment that touches nothing, from its tensions; False if none were found.

    Args:
        tensions: (4,) N.
        sliding: (4,) shares.
        stiffness: EI, N m^2.
        friction: mu, c in N, and the level.
        routing: pitch radius, length of the segment and ``chord``, m.
        z: (11,) filled, rad.
    """
    force, per_mode = np.empty(MODES), np.empty((MODES, MODES))
    per_tension, per_sliding = np.empty((MODES, 4)), np.empty((MODES, 4))
    per_level = np.empty(MODES)
    z[:] = 0.0
    for _ in range(_STEPS):
        tendon_forces(
            z, tensions, sliding, friction, routing,
            force, per_mode, per_tension, per_sliding, per_level,
        )  # fmt: skip
        moved = 0.0
        for a in range(2 * ORDERS):
            order = a % ORDERS
            wanted = (2.0 * order + 1.0) * routing[1] / stiffness * force[a]
            moved = max(moved, abs(wanted - z[a]))
            z[a] = wanted
        if not math.isfinite(moved):
            return False
        if moved < _SETTLED_RAD:
            return True
    return False


@compiled
def _predict(
    tensions: np.ndarray,
    sliding: np.ndarray,
    values: np.ndarray,
    routing: tuple[float, float, float],
    out: np.ndarray,
) -> None:
    z = np.empty(MODES)
    for row in range(tensions.shape[0]):
        friction = (values[1], values[2], 1.0)
        free_modes(tensions[row], sliding[row], values[0], friction, routing, z)
        tendon_lengths_of_modes(z, routing[0], routing[2], out[row])


def fit_sweep(
    tensions: np.ndarray,
    lengths: np.ndarray,
    sliding: np.ndarray,
    routing: tuple[float, float, float],
    first_stiffness: float,
) -> SweepFit:
    """Fit stiffness and friction.

    Args:
        tensions: (n, 4) at the base, N.
        lengths: (n, 4) changes of tendon lengths in the segment, m.
        sliding: (n, 4) shares of sliding; samples in which a bent pair turns around are best left
            out.
        routing: pitch radius, length of the segment and ``chord``, m.
        first_stiffness: EI to begin with, N m^2.

    Raises:
        SweepUnusable: too few samples, too little bend, numbers that are not finite, or a fit that
            ends at the edge of what is sensible.
    """
    count, pitch_radius = len(tensions), routing[0]
    pulled = lengths - lengths.mean(axis=1, keepdims=True)
    bend_deg = math.degrees(float(np.nan_to_num(np.abs(pulled)).max(initial=0.0)) / pitch_radius)
    if not all(np.isfinite(values).all() for values in (tensions, lengths, sliding)):
        raise SweepUnusable(count, bend_deg, "a reading is not a number")
    if count < FEWEST_SAMPLES or bend_deg < LEAST_BEND_DEG:
        raise SweepUnusable(count, bend_deg, "it is too short")
    predicted = np.empty_like(lengths)
    scale = np.array([first_stiffness, 0.1, 0.1])

    def left(share: np.ndarray) -> np.ndarray:
        _predict(tensions, sliding, share * scale, routing, predicted)
        # Where no bend balances the tensions, any bend is far off.
        off = np.nan_to_num((predicted - lengths).ravel() / pitch_radius, nan=_FAR, posinf=_FAR)
        return np.asarray(np.clip(off, -_FAR, _FAR))

    bounds = ([0.2, 0.0, 0.0], [5.0, 8.0, 20.0])
    found = least_squares(left, [1.0, 1.0, 0.2], bounds=bounds, x_scale=[0.1, 1.0, 1.0])
    stiffness, friction, coulomb = (found.x * scale).tolist()
    if found.x[0] > 4.9 or found.x[0] < 0.21:
        raise SweepUnusable(count, bend_deg, "no stiffness fits it")
    residual = float(np.sqrt(np.mean(found.fun**2)))
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * residual**2
    friction_sd = _relative_friction(covariance, found.x, bend_deg)
    return SweepFit(
        stiffness,
        max(_FLOOR, math.sqrt(covariance[0, 0]) / found.x[0]),
        friction,
        coulomb,
        max(_FLOOR, friction_sd),
        residual * pitch_radius,
    )


def fit_stretch(
    taken_up: np.ndarray, lengths: np.ndarray, tensions: np.ndarray
) -> tuple[float, np.ndarray]:
    """Stiffness of the tendons and what they carry while the segment is straight.

    A tendon's length in the segment is what its pulley has let out, plus its stretch beyond that of
    the straight segment: q = taken_up + (tau - tau_0) / k.

    Args:
        taken_up: (n, 4) what the pulleys have let out, m.
        lengths: (n, 4) changes of length in the segment, m.
        tensions: (n, 4) N.

    Returns:
        k in N/m, the same for all, and tau_0 (4,) in N. Slack tendons are left out.

    Raises:
        SweepUnusable: the tensions do not show any stretch.
    """
    count = len(tensions)
    columns = np.zeros((count, 4, 5))
    columns[:, :, 0] = tensions
    for i in range(4):
        columns[:, i, 1 + i] = -1.0
    taut = tensions.ravel() > _TAUT_N
    wanted = (lengths - taken_up).ravel()
    solved = np.linalg.lstsq(columns.reshape(-1, 5)[taut], wanted[taut], rcond=None)[0]
    if not solved[0] > 1e-8:
        bend_deg = math.degrees(float(np.abs(lengths).max(initial=0.0)))
        raise SweepUnusable(count, bend_deg, "the tensions do not grow with the stretch")
    return 1.0 / float(solved[0]), np.asarray(solved[1:] / solved[0])


def _relative_friction(covariance: np.ndarray, shares: np.ndarray, bend_deg: float) -> float:
    """Relative standard deviation of the friction of one newton of tension at half the bend."""
    per_share = np.array([0.1 * 0.5 * math.radians(bend_deg), 0.1])
    friction = float(per_share @ shares[1:])
    spread = math.sqrt(max(0.0, float(per_share @ covariance[1:, 1:] @ per_share)))
    return spread / friction if friction > 1e-3 else 0.5
