"""Stiffness that tendons give, and its modulation by tensions that cancel each other.

With energy U of the structure, tendons whose lengths change by q_i(x), and motors that hold their
ends, the stiffness in the degrees of freedom x is the Hessian of U + sum_i W_i(q_i - held_i):

    K = d2U/dx2 + A diag(k) A^T + sum_i tau_i d2q_i/dx2,    A = -J_q^T

with k_i = d tau_i / d q_i, the tangent stiffness of tendon and drive: 0 where the motor holds the
tension instead. Tension therefore stiffens in two ways only: where k_i grows with it, and where
d2q_i/dx2 is positive (twist). A tendon that runs straight between n disks shortens by c theta^2
with c = L / (8 n^2) and *softens* the bend by 2 c per newton. Tightening one pair of tendons alone
therefore stiffens its own direction and softens the other one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import linprog

from robot.errors import KeyholeError
from robot.tension.distribution import BoundsRefused, bounds_of, least_tension, solve_bounded
from robot.tension.structures import Structure

_SAME = 1e-9
_SCAN = 33


class StiffnessOutOfReach(KeyholeError):
    """No co-contraction within the bounds gives the wanted stiffness.

    Attributes:
        wanted: the stiffness asked for.
        lowest: the lowest of those that can be had.
        highest: the highest of them.
    """

    code = "stiffness_out_of_reach"

    def __init__(self, wanted: float, lowest: float, highest: float) -> None:
        super().__init__(
            f"stiffness {wanted:.6g} is out of reach: co-contraction gives {lowest:.6g} to "
            f"{highest:.6g}; ask for one of these or widen the bounds"
        )
        self.wanted, self.lowest, self.highest = wanted, lowest, highest


def hardened(tendon_stiffness: np.ndarray, hardening: float, tensions: np.ndarray) -> np.ndarray:
    """Tangent stiffness (m,) in N/m of tendons that grow stiffer as they are pulled.

    Args:
        tendon_stiffness: (m,) without tension, N/m.
        hardening: growth per newton, 1/m: the strands of a rope close up.
        tensions: (m,) N.
    """
    return np.asarray(tendon_stiffness + hardening * np.maximum(tensions, 0.0))


def chord_curvatures(structure: Structure, chord: float) -> np.ndarray:
    """(m, n, n) d2q_i/dx2 of a segment in (u, v) whose tendons run straight between disks.

    Args:
        structure: with (u, v) as its first two degrees of freedom; tendons are what can only pull.
        chord: c = L / (8 n^2) in m, so that q_i = -c (u^2 + v^2) + the linear part.
    """
    freedoms, count = structure.matrix.shape
    curvatures = np.zeros((count, freedoms, freedoms))
    curvatures[structure.pull_only, :2, :2] = -2.0 * chord * np.eye(2)
    return curvatures


def joint_stiffness(
    structure: Structure,
    tensions: np.ndarray,
    tendon_stiffness: np.ndarray,
    curvatures: np.ndarray | None = None,
    backbone: np.ndarray | None = None,
) -> np.ndarray:
    """K (n, n) = backbone + A diag(k) A^T + sum_i tau_i d2q_i/dx2, N m/rad for angles.

    Args:
        structure: of the instrument.
        tensions: (m,) N.
        tendon_stiffness: (m,) tangent stiffness of tendon and drive in N/m; 0 where the drive holds
            the tension.
        curvatures: (m, n, n) d2q_i/dx2, see :func:`chord_curvatures`; None for zero.
        backbone: (n, n) d2U/dx2; None for none.
    """
    stiffness = (structure.matrix * tendon_stiffness) @ structure.matrix.T
    if curvatures is not None:
        stiffness = stiffness + np.einsum("i,ijk->jk", tensions, curvatures)
    return np.asarray(stiffness if backbone is None else stiffness + backbone)


def _mean_row(structure: Structure) -> np.ndarray:
    """(m,) the row that gives the mean tension of what can only pull; zeros if nothing does."""
    return structure.pull_only / max(1, int(structure.pull_only.sum()))


def co_contraction_range(
    structure: Structure, tensions: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[float, float]:
    """Least and largest mean tension (N) that leave the generalised force as it is.

    Raises:
        TensionInfeasible: the bounds do not permit that generalised force.
        BoundsRefused: a bound that matters is infinite, see also ``bounds_of``.
    """
    low, high = bounds_of(structure, lower, upper)
    start = least_tension(structure, structure.matrix @ tensions, lower, upper)
    null, row = structure.null_space(), _mean_row(structure)
    along = row @ null
    present = float(row @ start)
    if not along.size or np.abs(along).max() < _SAME:
        return present, present
    ends = []
    for sign in (1.0, -1.0):
        found = linprog(
            sign * along,
            A_ub=np.vstack([null, -null]),
            b_ub=np.concatenate([high - start, start - low]).clip(0.0, 1e12),
            bounds=(None, None),
        )
        ends.append(present + float(along @ found.x))
    if max(map(abs, ends)) > 1e9:
        raise BoundsRefused("upper", "co-contraction needs finite bounds")
    return ends[0], ends[1]


def stiffen(
    structure: Structure,
    tensions: np.ndarray,
    level: float,
    lower: np.ndarray,
    upper: np.ndarray,
) -> np.ndarray:
    """Tensions (m,) of the same generalised force whose mean is ``level``, or as near as possible.

    Among these, those of the least sum of squares. The mean is over what can only pull. Where there
    is no redundancy nothing changes.

    Args:
        structure: of the instrument.
        tensions: (m,) present tensions, N; only their generalised force matters.
        level: wanted mean tension, N.
        lower: (m,) least tensions, N.
        upper: (m,) largest tensions, N.

    Raises:
        TensionInfeasible: the bounds do not permit the generalised force.
        BoundsRefused: see ``bounds_of``.
    """
    low, high = bounds_of(structure, lower, upper)
    force, row = structure.matrix @ tensions, _mean_row(structure)
    # Rows of one size, so that the rank is judged alike.
    size = float(np.abs(structure.matrix).max())
    rows = np.vstack([structure.matrix, size * row])

    def at(mean: float) -> np.ndarray | None:
        return solve_bounded(rows, np.append(force, size * mean), np.zeros_like(low), low, high)

    movable = row @ structure.null_space()
    if not movable.size or np.abs(movable).max() < _SAME:
        return least_tension(structure, force, lower, upper)
    found = at(level)
    if found is None:
        ends = co_contraction_range(structure, tensions, lower, upper)
        inward = _SAME * (1.0 if level > ends[1] else -1.0)
        limit = float(np.clip(level, *ends))
        found = at(limit)
        if found is None:  # the end itself, missed by rounding
            found = at(limit - inward)
        if found is None:
            found = least_tension(structure, force, lower, upper, limit)
    return found


def stiffen_to(
    structure: Structure,
    tensions: np.ndarray,
    wanted: float,
    stiffness_of: Callable[[np.ndarray], float],
    lower: np.ndarray,
    upper: np.ndarray,
) -> np.ndarray:
    """Tensions (m,) of the same generalised force with a wanted stiffness, at the least level.

    Args:
        structure: of the instrument.
        tensions: (m,) present tensions, N.
        wanted: stiffness.
        stiffness_of: stiffness at tensions (m,): a direction's, or the least eigenvalue, of
            :func:`joint_stiffness`. It need not rise all the way: the first of 33 levels beyond
            ``wanted`` is sought, then bisected.
        lower: (m,) least tensions, N.
        upper: (m,) largest tensions, N; finite.

    Raises:
        StiffnessOutOfReach: no level gives it.
        TensionInfeasible: the bounds do not permit the generalised force.
        BoundsRefused: see :func:`co_contraction_range`.
    """
    ends = co_contraction_range(structure, tensions, lower, upper)

    def error(level: float) -> float:
        return stiffness_of(stiffen(structure, tensions, level, lower, upper)) - wanted

    levels = np.linspace(*ends, _SCAN)
    errors = np.array([error(level) for level in levels])
    if abs(errors[0]) <= _SAME * abs(wanted):
        return stiffen(structure, tensions, levels[0], lower, upper)
    crossings = np.flatnonzero(np.sign(errors[:-1]) != np.sign(errors[1:]))
    if not crossings.size:
        raise StiffnessOutOfReach(wanted, wanted + errors.min(), wanted + errors.max())
    first = int(crossings[0])
    below, above = levels[first], levels[first + 1]
    for _ in range(60):
        middle = 0.5 * (below + above)
        if error(middle) * errors[first] > 0.0:
            below = middle
        else:
            above = middle
    return stiffen(structure, tensions, above, lower, upper)
