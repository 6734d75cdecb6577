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
from robot.concentric.sections import walk
from robot.concentric.state import ArmState, state_at_exit
from robot.concentric.tubes import ROUNDING
from robot.concentric.vectors import column, combine, cross

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
_FINEST_COUPLING = 1e-6
_NEAR = 0.1


@compiled
def _swap_rows(matrix: np.ndarray, first: int, second: int) -> None:
    for entry in range(matrix.shape[1]):
        held = matrix[first, entry]
        matrix[first, entry] = matrix[second, entry]
        matrix[second, entry] = held


@compiled
def _eliminate(matrix: np.ndarray, right: np.ndarray) -> float:
    """Determinant of ``matrix`` (n, n); ``right`` (n, m) becomes the solution, unless it is 0.

    ``matrix`` is overwritten (Gaussian elimination with partial pivoting).
    """
    count = len(matrix)
    determinant = 1.0
    for pivot in range(count):
        best = pivot
        for row in range(pivot + 1, count):
            if abs(matrix[row, pivot]) > abs(matrix[best, pivot]):
                best = row
        if matrix[best, pivot] == 0.0:
            return 0.0
        if best != pivot:
            determinant = -determinant
            _swap_rows(matrix, pivot, best)
            _swap_rows(right, pivot, best)
        determinant *= matrix[pivot, pivot]
        for row in range(count):
            if row == pivot:
                continue
            factor = matrix[row, pivot] / matrix[pivot, pivot]
            for entry in range(pivot, count):
                matrix[row, entry] -= factor * matrix[pivot, entry]
            for entry in range(right.shape[1]):
                right[row, entry] -= factor * right[pivot, entry]
    for row in range(count):
        for entry in range(right.shape[1]):
            right[row, entry] /= matrix[row, row]
    return determinant


@compiled
def _by_torsion(changes: np.ndarray) -> np.ndarray:
    """Copy (n, n) of the columns of ``changes`` (n, 3n) that are derivatives by the torsion."""
    count = len(changes)
    copy = np.empty((count, count))
    for row in range(count):
        for entry in range(count):
            copy[row, entry] = changes[row, 2 * count + entry]
    return copy


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
        for index in range(count):
            step[index, 0] = residual[index]
        if _eliminate(_by_torsion(residual_change), step) == 0.0:
            return SINGULAR
        share = 1.0
        for halving in range(_MOST_HALVINGS + 1):
            for index in range(count):
                trial[index] = torsion[index] - share * step[index, 0]
            state = state_at_exit(q, trial)
            walk(state, q, tubes, coupling, 2 * count, False, residual, residual_change)
            if _largest(residual) < size or halving == _MOST_HALVINGS:
                break
            share *= 0.5
        if not _largest(residual) < size:
            return NOT_CONVERGED
        size = _largest(residual)
        for index in range(count):
            torsion[index] = trial[index]
    return NOT_CONVERGED


@compiled
def solve_cold(q: np.ndarray, tubes: np.ndarray, torsion: np.ndarray) -> int:
    """Find the torsion of tubes that nothing is known about, by letting them couple gradually.

    Without coupling no tube is twisted, which is stable. The coupling grows in steps that keep the
    stability determinant above zero and the torsion near, so that the solution found is stable as
    well. Where several are, it is the one that untwisted tubes come to, not the one that a motion
    may have led to; tubes exactly opposite each other come to none where they cannot stay so.

    Args:
        q: (2n,) translations in m, rotations in rad.
        tubes: (n,) ``TUBE``.
        torsion: (n,) filled with torsion rates at the exit, rad/m: the guess for ``solve_arm``.

    Returns:
        ``SOLVED``; ``OUTSIDE``; ``SINGULAR`` where the tubes snap before they are fully coupled.
    """
    torsion.fill(0.0)
    if _is_outside(q, tubes):
        return OUTSIDE
    count = len(tubes)
    trial, residual, residual_change = torsion.copy(), np.empty(count), np.empty((count, 3 * count))
    coupling, step, determinant = 0.0, 0.25, 1.0
    while coupling < 1.0:
        ahead = min(coupling + step, 1.0)
        for index in range(count):
            trial[index] = torsion[index]
        followed = solve_torsion(q, tubes, ahead, trial) == SOLVED
        reached = 0.0
        if followed:
            state = state_at_exit(q, trial)
            walk(state, q, tubes, ahead, 2 * count, False, residual, residual_change)
            reached = _eliminate(_by_torsion(residual_change), np.empty((count, 0)))
        for index in range(count):
            followed = followed and abs(trial[index] - torsion[index]) < _NEAR
        if followed and reached > 0.5 * determinant:
            coupling, determinant = ahead, reached
            step = min(2.0 * step, 0.25)
            for index in range(count):
                torsion[index] = trial[index]
        else:
            step *= 0.5
            if step < _FINEST_COUPLING:
                return SINGULAR
    return SOLVED


@compiled
def _tip(state: ArmState, position: np.ndarray, rotation: np.ndarray, columns: np.ndarray) -> None:
    """Pose and its derivatives (6, 3n) from the Bishop frame's at the tip."""
    tangent = column(state.rotation, 2)
    here = (state.position[0], state.position[1], state.position[2])
    cosine, sine = math.cos(state.angle[0]), math.sin(state.angle[0])
    x_axis = combine(cosine, column(state.rotation, 0), sine, column(state.rotation, 1))
    y_axis = cross(tangent, x_axis)
    for row in range(3):
        position[row] = here[row]
        rotation[row, 0], rotation[row, 1], rotation[row, 2] = (
            x_axis[row],
            y_axis[row],
            tangent[row],
        )
    for parameter in range(columns.shape[1]):
        turn = column(state.turn, parameter)
        linear = cross(turn, here)
        change = state.angle_change[0, parameter]
        for row in range(3):
            columns[row, parameter] = linear[row] + state.moment[row, parameter]
            columns[3 + row, parameter] = turn[row] + tangent[row] * change
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
            :mod:`robot.concentric.stability`; below 0 the solution is one that tubes leave.

    Returns:
        ``SOLVED``, or why not; everything is NaN then.
    """
    count = len(tubes)
    solution = guess.copy()
    for out in (position, torsion, stability):
        out.fill(np.nan)
    for out in (rotation, jacobian, torsion_change):
        out.fill(np.nan)
    if _is_outside(q, tubes):
        return OUTSIDE
    status = solve_torsion(q, tubes, 1.0, solution)
    if status != SOLVED:
        return status
    residual, residual_change = np.empty(count), np.empty((count, 3 * count))
    columns = np.empty((6, 3 * count))
    state = state_at_exit(q, solution)
    # From the first parameter on; a literal 0 would have the walk compiled once more for itself.
    walk(state, q, tubes, 1.0, 0 * count, True, residual, residual_change)
    change = np.empty((count, 2 * count))
    for row in range(count):
        for parameter in range(2 * count):
            change[row, parameter] = -residual_change[row, parameter]
    determinant = _eliminate(_by_torsion(residual_change), change)
    if determinant == 0.0:
        return SINGULAR
    _tip(state, position, rotation, columns)
    stability[0] = determinant
    for index in range(count):
        torsion[index] = solution[index]
        for parameter in range(2 * count):
            torsion_change[index, parameter] = change[index, parameter]
    for row in range(6):
        for parameter in range(2 * count):
            jacobian[row, parameter] = columns[row, parameter]
            for index in range(count):
                jacobian[row, parameter] += (
                    columns[row, 2 * count + index] * change[index, parameter]
                )
    return SOLVED
