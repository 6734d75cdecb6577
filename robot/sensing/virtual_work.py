"""The force at the tip from shape and tensions, by virtual work: three ways to close the balance.

Virtual work leaves one equation for each coordinate of the shape S,

    Q(tau) + J_xS^T F = dU/dS        Q = -J_qS^T tau without friction

(paper 3, eq. (41), whose sign of the tensions belongs to another sign of q). F is what the
environment does to the tip, in the segment's base frame. With a moment F has six unknowns for four
equations, so an assumption has to close them:

- ``wrench_with_prior``, paper 3, eqs. (43), (44): of all wrenches that balance, the one nearest to
  a prior F0, newtons and newton metres counted alike as printed. Force and moment trade against
  each other.
- ``force_without_moment``: a point touches, so there is no moment; least squares in three unknowns.
- ``force_along``: besides, it is known along which axis it pushes; one unknown.

Friction lets the tension T_i(s) of a tendon fall toward the tip, see ``tendon_forces_on_shape``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robot.compiled import compiled
from robot.errors import KeyholeError
from robot.sensing.polynomial_curvature import (
    PLACES,
    STATES,
    TENDONS,
    WEIGHTS,
    bend_at,
    curvature_at,
    energy_gradient,
    tip_jacobian,
)

_NEGLIGIBLE = 1e-9
"""Singular values below this share of the largest count as zero."""
_LEAST_GAIN = 1e-3
"""Share of the segment's length that a force has as its lever at the least to be observable."""


class SegmentModel(NamedTuple):
    """What the balance needs to know of a segment.

    Attributes:
        length: m.
        pitch_radius: of the tendons, m.
        bending_stiffness: EI of the backbone, N m^2.
    """

    length: float
    pitch_radius: float
    bending_stiffness: float


class TendonLoad(NamedTuple):
    """What the tendons do, and what is known of their friction.

    Attributes:
        tensions: (4,) at the base, N.
        sliding: (4,) shares in [-1, 1]; 1 for a tendon that slides toward the base.
        friction: capstan coefficient mu.
        coulomb: the part that does not grow with bend, N.
    """

    tensions: np.ndarray
    sliding: np.ndarray = np.zeros(TENDONS)
    friction: float = 0.0
    coulomb: float = 0.0


class Balance(NamedTuple):
    """What the wrench F at the tip has to balance: J^T F = missing.

    Attributes:
        jacobian: J (6, n), tip twist per rate of the shape's n coordinates, segment base frame.
        missing: (n,) dU/dS - Q(tau), N m.
        length: of the segment, m.
    """

    jacobian: np.ndarray
    missing: np.ndarray
    length: float


class WrenchEstimate(NamedTuple):
    """What the environment does to the tip, segment base frame.

    Attributes:
        force: (3,) N.
        moment: (3,) N m.
        unexplained: (n,) what is left of the balance, N m.
        gains: singular values of the map from the unknowns to the balance, largest first; for
            forces in m. An error of the balance (N m) comes out divided by them.
    """

    force: np.ndarray
    moment: np.ndarray
    unexplained: np.ndarray
    gains: np.ndarray


class ForceNotObservable(KeyholeError):
    """A force along the given axis would not change the shape.

    Attributes:
        axis: (3,) the axis, segment base frame.
        lever_m: how much of the balance (N m) one newton along it makes.
    """

    code = "force_not_observable"

    def __init__(self, axis: np.ndarray, lever_m: float) -> None:
        super().__init__(
            f"a force along ({axis[0]:.3f}, {axis[1]:.3f}, {axis[2]:.3f}) at the tip hardly "
            f"changes this shape (lever {lever_m * 1e3:.4f} mm); "
            "bend the segment or give another axis"
        )
        self.axis, self.lever_m = axis, lever_m


@compiled
def _split_at_inflections(shape: np.ndarray, ends: np.ndarray) -> int:
    """Pieces of [0, 1] within which kappa keeps its sign: their ends, 0 and 1 among them.

    Args:
        shape: (4,) S.
        ends: (4,) filled as far as needed.

    Returns:
        How many pieces there are.
    """
    count = 1
    ends[0] = 0.0
    a, b, c = shape[2], shape[1], shape[0]
    inside = b * b - 4.0 * a * c
    if inside > 0.0:
        # The form without cancellation; its second root is infinite where a is zero.
        half = -0.5 * (b + math.copysign(math.sqrt(inside), b))
        first = half / a if a != 0.0 else 2.0
        second = c / half
        for root in (min(first, second), max(first, second)):
            if 0.0 < root < 1.0:
                ends[count] = root
                count += 1
    ends[count] = 1.0
    return count


@compiled
def tendon_forces_on_shape(
    shape: np.ndarray,
    pitch_radius: float,
    tensions: np.ndarray,
    sliding: np.ndarray,
    friction: tuple[float, float],
    out: np.ndarray,
) -> None:
    """Generalised forces of four tendons with friction on S; -J_qS^T tau without.

    With c_i = cos(delta + i 90 deg), s_i its sine and l_i' = L - r kappa c_i,

        Q_mk = sum_i r c_i int T_i s^k ds,      Q_delta = -sum_i r s_i int T_i kappa ds,
        T_i(s) = (tau_i - f_i c) exp(-f_i mu phi(s)),      phi(s) = int_0^s |kappa| ds.

    Args:
        shape: (4,) S.
        pitch_radius: m.
        tensions: (4,) tau at the base, N.
        sliding: (4,) shares f.
        friction: mu, and c in N.
        out: (4,) filled, N m.
    """
    mu, coulomb = friction
    out[:] = 0.0
    ends = np.empty(4)
    pieces = _split_at_inflections(shape, ends)
    at_start = 0.0
    for piece in range(pieces):
        start, size = ends[piece], ends[piece + 1] - ends[piece]
        bend_at_start = bend_at(shape, start)
        for j in range(PLACES.size):
            s = start + size * PLACES[j]
            accumulated = at_start + abs(bend_at(shape, s) - bend_at_start)
            kappa, w = curvature_at(shape, s), pitch_radius * size * WEIGHTS[j]
            for i in range(TENDONS):
                f = sliding[i]
                tension = (tensions[i] - f * coulomb) * math.exp(-f * mu * accumulated)
                angle = shape[3] + 0.5 * math.pi * i
                toward = w * tension * math.cos(angle)
                out[0] += toward
                out[1] += toward * s
                out[2] += toward * s * s
                out[3] -= w * tension * math.sin(angle) * kappa
        at_start += abs(bend_at(shape, start + size) - bend_at_start)


@compiled
def fill_balance(
    shape: np.ndarray,
    segment: tuple[float, float, float],
    tensions: np.ndarray,
    sliding: np.ndarray,
    friction: tuple[float, float],
    jacobian: np.ndarray,
    missing: np.ndarray,
) -> None:
    """The balance of a polynomial curvature, see ``Balance``.

    Args:
        shape: (4,) S.
        segment: length (m), pitch radius (m), EI (N m^2).
        tensions: (4,) at the base, N.
        sliding: (4,) shares.
        friction: mu, and c in N.
        jacobian: (6, 4) filled.
        missing: (4,) filled, N m.
    """
    length, pitch_radius, stiffness = segment
    by_tendons = np.empty(STATES)
    tendon_forces_on_shape(shape, pitch_radius, tensions, sliding, friction, by_tendons)
    energy_gradient(shape, stiffness, length, missing)
    for k in range(STATES):
        missing[k] -= by_tendons[k]
    tip_jacobian(shape, length, jacobian)


@compiled
def nearest_solution(
    rows: np.ndarray, missing: np.ndarray, prior: np.ndarray, out: np.ndarray, gains: np.ndarray
) -> None:
    """Of all least-squares solutions of ``rows`` x = ``missing`` the one nearest to ``prior``.

    x = prior + rows^+ (missing - rows prior): paper 3, eq. (43) with eta = F0 for (44).

    Args:
        rows: (n, k).
        missing: (n,).
        prior: (k,).
        out: (k,) filled.
        gains: (min(n, k),) filled with the singular values.
    """
    left, values, right = np.linalg.svd(rows, False)
    gains[:] = values
    out[:] = prior
    for a in range(values.size):
        if values[a] <= _NEGLIGIBLE * values[0] or values[a] == 0.0:
            continue
        part = 0.0
        for n in range(missing.size):
            left_over = missing[n]
            for k in range(prior.size):
                left_over -= rows[n, k] * prior[k]
            part += left[n, a] * left_over
        for k in range(prior.size):
            out[k] += right[a, k] * part / values[a]


@compiled
def wrench_of_balance(
    jacobian: np.ndarray, missing: np.ndarray, unknowns: np.ndarray, prior: np.ndarray,
    wrench: np.ndarray, unexplained: np.ndarray, gains: np.ndarray,
) -> None:  # fmt: skip
    """Wrench that balances, in the span of some directions and nearest to a prior in it.

    Args:
        jacobian: (6, n).
        missing: (n,) N m.
        unknowns: (6, k) orthonormal directions: all six, the three forces, or one axis.
        prior: (k,) of the amounts along them.
        wrench: (6,) filled, N and N m.
        unexplained: (n,) filled, N m.
        gains: (min(n, k),) filled.
    """
    count, amounts = missing.size, np.empty(prior.size)
    rows = np.zeros((count, prior.size))
    for n in range(count):
        for k in range(prior.size):
            for i in range(6):
                rows[n, k] += jacobian[i, n] * unknowns[i, k]
    nearest_solution(rows, missing, prior, amounts, gains)
    for i in range(6):
        wrench[i] = 0.0
        for k in range(prior.size):
            wrench[i] += unknowns[i, k] * amounts[k]
    for n in range(count):
        unexplained[n] = missing[n]
        for k in range(prior.size):
            unexplained[n] -= rows[n, k] * amounts[k]


def plain(
    segment: SegmentModel, load: TendonLoad
) -> tuple[tuple[float, float, float], np.ndarray, np.ndarray, tuple[float, float]]:
    """Segment, tensions, sliding shares and friction as the compiled functions take them."""
    return (
        (float(segment.length), float(segment.pitch_radius), float(segment.bending_stiffness)),
        np.asarray(load.tensions, dtype=float),
        np.asarray(load.sliding, dtype=float),
        (float(load.friction), float(load.coulomb)),
    )


def balance(shape: np.ndarray, segment: SegmentModel, load: TendonLoad) -> Balance:
    """The balance of the polynomial curvature S = ``shape`` (4,)."""
    jacobian, missing = np.empty((6, STATES)), np.empty(STATES)
    fill_balance(np.asarray(shape, dtype=float), *plain(segment, load), jacobian, missing)
    return Balance(jacobian, missing, segment.length)


def wrench_with_prior(given: Balance, prior: np.ndarray | None = None) -> WrenchEstimate:
    """Paper 3, eq. (43): the wrench nearest to ``prior`` (6,), N and N m, of those that balance.

    Without a prior it is zero. Directions that change nothing echo the prior.
    """
    return _estimate(given, np.eye(6), np.zeros(6) if prior is None else np.asarray(prior, float))


def force_without_moment(given: Balance) -> WrenchEstimate:
    """The force that leaves least of the balance, with no moment at the tip.

    Where several do as well (a straight segment, an arc) it is the smallest of them.
    """
    return _estimate(given, np.eye(6)[:, :3], np.zeros(3))


def force_along(given: Balance, axis: np.ndarray) -> WrenchEstimate:
    """The force along ``axis`` (3,) that leaves least of the balance, with no moment at the tip.

    Raises:
        ForceNotObservable: a force along the axis hardly changes this shape.
    """
    direction = np.zeros((6, 1))
    direction[:3, 0] = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    found = _estimate(given, direction, np.zeros(1))
    if not found.gains[0] > _LEAST_GAIN * given.length:
        raise ForceNotObservable(direction[:3, 0], float(found.gains[0]))
    return found


def _estimate(given: Balance, unknowns: np.ndarray, prior: np.ndarray) -> WrenchEstimate:
    count, free = len(given.missing), len(prior)
    wrench, unexplained, gains = np.empty(6), np.empty(count), np.empty(min(count, free))
    wrench_of_balance(
        given.jacobian, given.missing, np.ascontiguousarray(unknowns), prior,
        wrench, unexplained, gains,
    )  # fmt: skip
    return WrenchEstimate(wrench[:3], wrench[3:], unexplained, gains)
