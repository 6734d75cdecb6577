"""Tensions that give a wanted generalised force: the least ones, and the nearest where none do.

    minimise |tau - common|^2   subject to   A tau = wanted,   lower <= tau <= upper

The equality is eliminated: tau = tau_p + N z with orthonormal N spanning the null space of A, so
that it holds to rounding, and daqp, an exact dual active-set solver, meets the bounds in z.
"""

from __future__ import annotations

import daqp
import numpy as np
from scipy.optimize import lsq_linear

from robot.errors import KeyholeError
from robot.tension.structures import Structure

_RANK_TOLERANCE = 1e-9
_PRIMAL_TOLERANCE = 1e-10
_OPTIMAL = 1
_EDGE = 1e-9
"""A wanted force this near to a feasible one, relative to what the actuators can do per newton (N),
is on the edge of the feasible ones, not beyond it."""


class TensionInfeasible(KeyholeError):
    """No tensions within their bounds give the wanted generalised force.

    Attributes:
        wanted: (n,) the generalised force asked for.
        nearest: (n,) the nearest one that can be had.
        tensions: (m,) tensions that give the nearest one.
        limits: what stands in the way: actuators with the bound that they are at, in words.
    """

    code = "tension_infeasible"

    def __init__(
        self,
        structure: Structure,
        wanted: np.ndarray,
        nearest: np.ndarray,
        tensions: np.ndarray,
        limits: tuple[str, ...],
    ) -> None:
        asked = ", ".join(
            f"{name} {value:.4g} (nearest {near:.4g})"
            for name, value, near in zip(structure.freedoms, wanted, nearest, strict=True)
        )
        super().__init__(
            f"{structure.name}: no tensions give {asked}; limited by {', '.join(limits)}; "
            "ask for less or widen the bounds"
        )
        self.wanted, self.nearest, self.tensions = wanted, nearest, tensions
        self.limits = limits


class BoundsRefused(KeyholeError):
    """A tension's bounds are empty or not numbers, or an array has not the structure's length.

    Attributes:
        what: which argument is refused.
    """

    code = "tension_bounds"

    def __init__(self, what: str, detail: str) -> None:
        super().__init__(f"{what}: {detail}")
        self.what = what


def bounds_of(
    structure: Structure, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (m,), (m,) with the lower ones of what can only pull raised to zero.

    Raises:
        BoundsRefused: they are not (m,), NaN, or a lower one is above its upper one.
    """
    count = structure.matrix.shape[1]
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    for what, bound in (("lower", low), ("upper", high)):
        if bound.shape != (count,) or np.isnan(bound).any():
            raise BoundsRefused(what, f"{structure.name} needs {count} numbers")
    low = np.where(structure.pull_only, np.maximum(low, 0.0), low)
    if (low > high).any():
        name = structure.actuators[int(np.argmax(low > high))]
        raise BoundsRefused("lower", f"{name} has its lower bound above its upper one")
    return low, high


def solve_bounded(
    rows: np.ndarray, right: np.ndarray, centre: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray | None:
    """The tau (m,) nearest to ``centre`` with ``rows @ tau = right`` in the bounds, or None.

    Args:
        rows: (n, m), may be dependent.
        right: (n,).
        centre: (m,).
        low: (m,) lower bounds.
        high: (m,) upper bounds.
    """
    left, values, axes = np.linalg.svd(rows)
    rank = int(np.sum(values > _RANK_TOLERANCE * values[0]))
    along = left.T @ right
    if rank < len(along) and np.abs(along[rank:]).max() > _EDGE * values[0]:
        return None
    null = axes[rank:].T
    particular = axes[:rank].T @ (along[:rank] / values[:rank])
    particular += null @ (null.T @ centre)
    if null.shape[1]:
        z, _, flag, _ = daqp.solve(
            np.eye(null.shape[1]),
            np.zeros(null.shape[1]),
            np.ascontiguousarray(null),
            high - particular,
            low - particular,
            primal_tol=_PRIMAL_TOLERANCE,
        )
        if flag != _OPTIMAL:
            return None
        particular = particular + null @ z
    inside = np.clip(particular, low, high)
    if np.abs(inside - particular).max() > _EDGE:
        return None
    return np.asarray(inside)


def nearest_bounded(
    rows: np.ndarray, right: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Tensions (m,) in their bounds with the least ``|rows @ tau - right|``.

    Args:
        rows: (n, m).
        right: (n,).
        low: (m,) lower bounds.
        high: (m,) upper bounds.
    """
    free = low < high
    tensions = low.copy()
    if free.any():
        tensions[free] = lsq_linear(
            rows[:, free],
            right - rows[:, ~free] @ low[~free],
            (low[free], high[free]),
            method="bvls",
            tol=1e-14,
        ).x
    return np.asarray(np.clip(tensions, low, high))


def nearest_feasible(
    structure: Structure, wanted: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """The generalised force nearest to the wanted one that the bounds permit.

    Near as the sum of squares over the degrees of freedom, which therefore should have one unit.

    Args:
        structure: of the instrument.
        wanted: (n,) generalised force.
        lower: (m,) least tensions, N.
        upper: (m,) largest tensions, N; inf where there is none.

    Returns:
        (n,) the force, (m,) the least tensions that give it, and what limits it, in words: none
        where the wanted force itself can be had.

    Raises:
        BoundsRefused: see :func:`bounds_of`.
    """
    low, high = bounds_of(structure, lower, upper)
    wanted = np.asarray(wanted, dtype=float)
    if wanted.shape != structure.matrix.shape[:1] or not np.isfinite(wanted).all():
        raise BoundsRefused("wanted", f"{structure.name} needs {len(structure.freedoms)} numbers")
    scale = float(np.linalg.norm(structure.matrix, 2))
    rows, right = structure.matrix / scale, wanted / scale
    tensions = nearest_bounded(rows, right, low, high)
    nearest = structure.matrix @ tensions
    least = solve_bounded(structure.matrix, nearest, np.zeros_like(low), low, high)
    if least is not None:
        tensions, nearest = least, structure.matrix @ least
    return nearest, tensions, _limits(structure, rows, rows @ tensions - right, tensions, low)


def _limits(
    structure: Structure,
    rows: np.ndarray,
    residual: np.ndarray,
    tensions: np.ndarray,
    low: np.ndarray,
) -> tuple[str, ...]:
    """Actuators that would have to pass their bounds to reduce the residual (n,)."""
    size = float(np.linalg.norm(residual))
    if size <= _EDGE:
        return ()
    pull = rows.T @ residual
    limits = tuple(
        f"{name} at its {'lower' if tensions[i] == low[i] else 'upper'} bound {tensions[i]:.4g} N"
        for i, name in enumerate(structure.actuators)
        if abs(pull[i]) > 1e-7 * size
    )
    return limits or ("the structure, whose actuators do not act that way",)


def least_tension(
    structure: Structure,
    wanted: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    common: float | np.ndarray = 0.0,
) -> np.ndarray:
    """The tensions (m,) in N nearest to ``common`` that give the wanted generalised force.

    Args:
        structure: of the instrument.
        wanted: (n,) generalised force, N m for an angle.
        lower: (m,) least tensions, N: what keeps a tendon from going slack. Of what can only pull,
            never below zero.
        upper: (m,) largest tensions, N.
        common: co-contraction that is sought, N, one for all or (m,); 0 for the least sum of
            squares.

    Raises:
        TensionInfeasible: the bounds or the structure do not permit it.
        BoundsRefused: see :func:`bounds_of`.
    """
    low, high = bounds_of(structure, lower, upper)
    wanted = np.asarray(wanted, dtype=float)
    if wanted.shape == structure.matrix.shape[:1] and np.isfinite(wanted).all():
        centre = np.broadcast_to(np.asarray(common, dtype=float), low.shape)
        tensions = solve_bounded(structure.matrix, wanted, centre, low, high)
        if tensions is not None:
            return tensions
    nearest, tensions, limits = nearest_feasible(structure, wanted, lower, upper)
    if limits:
        raise TensionInfeasible(structure, wanted, nearest, tensions, limits)
    return tensions
