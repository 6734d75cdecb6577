"""Kinematics of one arm of concentric tubes: the tip, its Jacobian, and how stable it is.

Torsionally compliant tubes of piecewise constant precurvature (paper 2's model; Dupont, Lock,
Itkowitz & Butler 2010; Rucker, Webster, Chirikjian & Cowan 2010). The unknown is the torsion rate
ω_i of each tube at the channel's exit; it is right when every tube ends without torsion. Base
frame: origin at the channel's exit, z out of the channel; at α = 0 a tube's curvature is about x,
so that it bends toward −y. The tip's frame is that of the innermost tube.

The Jacobian follows from one walk along the arm that carries the derivatives by β, α and ω, and
from the implicit function theorem: ω(β, α) keeps the torsion at the ends zero.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.concentric.helix import cross
from robot.concentric.sections import walk
from robot.concentric.state import ArmState, state_at_exit
from robot.concentric.tubes import ROUNDING

SOLVED = 0
NOT_CONVERGED = 1
OUTSIDE = 2
SINGULAR = 3
"""Statuses: solved; no solution found near the guess; q is not finite, or a tube ends in the
channel, beyond the tube inside it or begins beyond the exit; the tubes are just about to snap."""

TOLERANCE = 1e-10
"""Torsion rate (rad/m) at the tubes' ends below which the boundary problem counts as solved."""

_MOST_STEPS = 30
_MOST_HALVINGS = 8


@compiled
def eliminate(matrix: np.ndarray, right: np.ndarray) -> float:
    """Determinant of ``matrix`` (n, n); ``right`` (n, m) becomes the solution, unless it is 0.

    ``matrix`` is overwritten (Gaussian elimination with partial pivoting).
    """
    count = len(matrix)
    determinant = 1.0
    for column in range(count):
        pivot = column
        for row in range(column + 1, count):
            if abs(matrix[row, column]) > abs(matrix[pivot, column]):
                pivot = row
        if matrix[pivot, column] == 0.0:
            return 0.0
        if pivot != column:
            determinant = -determinant
            for other in range(count):
                swapped = matrix[column, other]
                matrix[column, other], matrix[pivot, other] = matrix[pivot, other], swapped
            for other in range(right.shape[1]):
                swapped = right[column, other]
                right[column, other], right[pivot, other] = right[pivot, other], swapped
        determinant *= matrix[column, column]
        for row in range(count):
            if row != column:
                factor = matrix[row, column] / matrix[column, column]
                matrix[row, :] -= factor * matrix[column, :]
                right[row, :] -= factor * right[column, :]
    for row in range(count):
        right[row, :] /= matrix[row, row]
    return determinant


@compiled
def _is_outside(q: np.ndarray, tubes: np.ndarray) -> bool:
    """Whether the model means nothing at ``q``; where a tube's rear end meets another is no matter
    of the model.
    """
    for value in q:
        if not math.isfinite(value):
            return True
    for index in range(len(tubes)):
        end = q[index] + tubes[index]["length"]
        if q[index] > ROUNDING or end < -ROUNDING:
            return True
        if index and end > q[index - 1] + tubes[index - 1]["length"] + ROUNDING:
            return True
    return False


@compiled
def _largest(values: np.ndarray) -> float:
    largest = 0.0
    for value in values:
        if not math.isfinite(value):
            return np.inf
        largest = max(largest, abs(value))
    return largest


@compiled
def solve_torsion(q: np.ndarray, tubes: np.ndarray, coupling: float, torsion: np.ndarray) -> int:
    """Find the torsion rates at the exit with which every tube ends without torsion.

    Newton's method; a step that does not lessen the torsion at the ends is halved.

    Args:
        q: (2n,) translations in m, rotations in rad.
        tubes: (n,) ``TUBE``.
        coupling: as in :func:`robot.concentric.state.share_out`.
        torsion: (n,) the guess, overwritten by the solution, rad/m.

    Returns:
        ``SOLVED``, ``NOT_CONVERGED`` or ``SINGULAR``.
    """
    count = len(tubes)
    residual, residual_change = np.empty(count), np.empty((count, 3 * count))
    step, trial = np.empty((count, 1)), np.empty(count)
    walk(state_at_exit(q, torsion), q, tubes, coupling, 2 * count, False, residual, residual_change)
    size = _largest(residual)
    for _ in range(_MOST_STEPS):
        if size < TOLERANCE:
            return SOLVED
        step[:, 0] = residual
        if eliminate(residual_change[:, 2 * count :].copy(), step) == 0.0:
            return SINGULAR
        share = 1.0
        for halving in range(_MOST_HALVINGS + 1):
            trial[:] = torsion - share * step[:, 0]
            state = state_at_exit(q, trial)
            walk(state, q, tubes, coupling, 2 * count, False, residual, residual_change)
            if _largest(residual) < size or halving == _MOST_HALVINGS:
                break
            share *= 0.5
        if not _largest(residual) < size:
            return NOT_CONVERGED
        size = _largest(residual)
        torsion[:] = trial
    return NOT_CONVERGED


@compiled
def _tip(
    state: ArmState, q: np.ndarray, position: np.ndarray, rotation: np.ndarray, columns: np.ndarray
) -> None:
    """Pose and its derivatives (6, 3n) from the Bishop frame's at the tip."""
    tangent = state.rotation[:, 2]
    cosine, sine = math.cos(state.angle[0]), math.sin(state.angle[0])
    position[:] = state.position
    rotation[:, 0] = cosine * state.rotation[:, 0] + sine * state.rotation[:, 1]
    rotation[:, 1] = cosine * state.rotation[:, 1] - sine * state.rotation[:, 0]
    rotation[:, 2] = tangent
    for column in range(columns.shape[1]):
        linear = cross(state.turn[:, column], state.position)
        for row in range(3):
            columns[row, column] = linear[row] + state.moment[row, column]
            turn = tangent[row] * state.angle_change[0, column]
            columns[3 + row, column] = state.turn[row, column] + turn
    for row in range(3):
        columns[row, 0] += tangent[row]
        columns[3 + row, 0] += tangent[row] * state.rate[0]


@compiled
def solve_arm(
    q: np.ndarray,
    guess: np.ndarray,
    tubes: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    jacobian: np.ndarray,
    torsion: np.ndarray,
    torsion_change: np.ndarray,
    stability: np.ndarray,
) -> int:
    """Tip, Jacobian, torsion and stability of one arm; never raises.

    Args:
        q: (2n,) translations in m, then rotations in rad.
        guess: (n,) torsion rates of a solution nearby, rad/m: the branch that is followed.
        tubes: (n,) ``TUBE``.
        position: (3,) of the tip, m, base frame; filled.
        rotation: (3, 3) of the tip's frame (the innermost tube's) in the base frame; filled.
        jacobian: (6, 2n) filled; rows linear (m/m, m/rad) then angular (rad/m, rad/rad), base
            frame, columns translations then rotations.
        torsion: (n,) filled with the torsion rates at the exit, rad/m.
        torsion_change: (n, 2n) filled with their derivative by q: torsion + torsion_change @ dq is
            the guess for q + dq.
        stability: (1,) filled with the stability determinant, see
            :mod:`robot.concentric.stability`.

    Returns:
        ``SOLVED``, or why not; everything is NaN then.
    """
    count = len(tubes)
    position[:], rotation[:], jacobian[:], torsion_change[:] = np.nan, np.nan, np.nan, np.nan
    stability[0] = np.nan
    torsion[:] = guess
    status = OUTSIDE
    if not _is_outside(q, tubes):
        status = solve_torsion(q, tubes, 1.0, torsion)
    if status != SOLVED:
        torsion[:] = np.nan
        return status
    residual, residual_change = np.empty(count), np.empty((count, 3 * count))
    columns = np.empty((6, 3 * count))
    state = state_at_exit(q, torsion)
    walk(state, q, tubes, 1.0, 0, True, residual, residual_change)
    _tip(state, q, position, rotation, columns)
    torsion_change[:] = -residual_change[:, : 2 * count]
    stability[0] = eliminate(residual_change[:, 2 * count :].copy(), torsion_change)
    if stability[0] == 0.0:
        return SINGULAR
    by_torsion = np.ascontiguousarray(columns[:, 2 * count :])
    jacobian[:] = columns[:, : 2 * count] + by_torsion @ torsion_change
    return SOLVED
