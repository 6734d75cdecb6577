"""Shape and force together, from tip pose, tendon lengths and tendon tensions, with a covariance.

One weighted least-squares problem holds everything that is known. Unknown are the eleven modes of
curvature z, the force F of the environment on the tip, the true tensions tau, how far the bending
stiffness and the level of friction are from their calibration, and the sliding shares of the
tendons. Residuals, each over its standard deviation:

- tip pose: measured minus that of z (position in m, rotation vector in rad, base frame);
- tendon lengths: measured minus those of z;
- balance of virtual work in every mode: (1 + e) dU/dz - Q(z, tau, f, g) - J_p(z)^T F, where
  dU/dz = (EI / L) z over the norm of the modes (paper 3, eq. (42), in orthogonal polynomials);
- tensions, force, stiffness, friction, sliding shares: away from what was measured or calibrated.

Gauss-Newton solves it cold, from the constant curvature that the pose's rotation shows; the inverse
of the normal matrix is the covariance. Paper 3 solves the shape alone from the pose, then the force
from the shape (eqs. (38), (43)); here the tensions make the shape better too, and what the force
could not be told apart from stands in its covariance.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.records import RecordFields
from robot.rotations import logarithm
from robot.sensing.curvature_modes import (
    MODES,
    NODES,
    NORMS,
    ORDERS,
    TWIST,
    force_stiffness,
    frames_at_nodes,
    tip_jacobian_of_modes,
    turned_axes,
)
from robot.sensing.tendon_work import tendon_forces, tendon_lengths_of_modes

FORCE = MODES
TENSION, STIFFNESS, LEVEL, SLIDING = FORCE + 3, FORCE + 7, FORCE + 8, FORCE + 9
"""Where force (3), tensions (4), relative error of stiffness, level of friction and sliding shares
(4) stand among the unknowns, after the modes."""
UNKNOWNS = SLIDING + 4
_BALANCE = 10
_BEFORE = _BALANCE + MODES
_ROWS = _BEFORE + 13
_MOST_STEPS = 20
_SETTLED = 1e-4
"""A step whose square, in standard deviations of the estimate, is below this ends the search."""
_LARGEST_TURN = 0.7
"""No step changes a mode by more than this, rad."""

MODEL = np.dtype(
    [
        ("length", "f8"),
        ("pitch_radius", "f8"),
        ("chord", "f8"),
        ("contact_offset", "f8"),
        ("bending_stiffness", "f8"),
        ("torsion_stiffness", "f8"),
        ("friction", "f8"),
        ("coulomb", "f8"),
        ("stiffness_deviation", "f8"),
        ("friction_deviation", "f8"),
        ("position_deviation", "f8"),
        ("angle_deviation", "f8"),
        ("length_deviation", "f8"),
        ("tension_deviation", "f8"),
        ("sliding_deviation", "f8"),
        ("balance_deviation", "f8"),
    ]
)
"""The segment as calibrated, and standard deviations. Lengths in m (``chord``: see
:mod:`robot.sensing.tendon_work`; ``contact_offset``: how far behind the tip on its axis a contact
acts, which for a rounded end is the centre of the rounding), stiffness in N m^2, friction mu, its
Coulomb part in N. Deviations of stiffness and friction are relative; then position m, angle rad,
tendon length m, tension N, sliding share, and the balance of virtual work N m (what the polynomials
leave out)."""

SAMPLE = np.dtype(
    [
        ("position", "f8", 3),
        ("rotation", "f8", (3, 3)),
        ("lengths", "f8", 4),
        ("tensions", "f8", 4),
        ("sliding", "f8", 4),
        ("force", "f8", 3),
        ("force_weight", "f8", (3, 3)),
    ]
)
"""What is known at one instant, in the segment's base frame: tip pose (m), length changes of the
tendons (m), tensions at the base (N), sliding shares, and what is known of the force beforehand (N)
with the inverse of a root of its covariance (1/N)."""

ESTIMATE = np.dtype(
    [
        ("settled", "i8"),
        ("steps", "i8"),
        ("unknowns", "f8", UNKNOWNS),
        ("covariance", "f8", (UNKNOWNS, UNKNOWNS)),
        ("position", "f8", 3),
        ("rotation", "f8", (3, 3)),
        ("pose_misfit", "f8"),
        ("length_misfit", "f8"),
        ("misfit", "f8"),
    ]
)
"""``settled``: whether the search ended; ``position``, ``rotation``: of the tip as estimated;
``pose_misfit``: sum of squares of the six pose residuals, in standard deviations, likewise of the
lengths, and of all residuals."""


@compiled
def _weigh(
    rows: np.ndarray, residual: np.ndarray, start: int, count: int, deviation: float
) -> None:
    share = 1.0 / deviation
    for i in range(start, start + count):
        residual[i] *= share
        for a in range(UNKNOWNS):
            rows[i, a] *= share


@compiled
def residuals(
    y: np.ndarray,
    sample: np.ndarray,
    model: np.ndarray,
    tip_position: np.ndarray,
    tip_rotation: np.ndarray,
    residual: np.ndarray,
    rows: np.ndarray,
) -> None:
    """Weighted residuals at ``y`` and their derivatives.

    Args:
        y: (24,) unknowns.
        sample: (1,) ``SAMPLE``.
        model: (1,) ``MODEL``.
        tip_position: (3,) filled, m.
        tip_rotation: (3, 3) filled.
        residual: (34,) filled.
        rows: (34, 24) filled; of the rotation they hold at the solution, where it fits.
    """
    d, p = sample[0], model[0]
    z = y[:MODES]
    rotations, positions = np.empty((NODES, 3, 3)), np.empty((NODES, 3))
    axes, jacobian = np.empty((NODES, MODES, 3)), np.empty((6, MODES))
    frames_at_nodes(z, p.length, rotations, positions, tip_rotation, tip_position)
    turned_axes(rotations, axes)
    tip_jacobian_of_modes(axes, positions, tip_position, jacobian)
    residual[:], rows[:] = 0.0, 0.0
    off, turn = np.empty((3, 3)), np.empty(3)
    for i in range(3):
        residual[i] = d.position[i] - tip_position[i]
        for j in range(3):
            off[i, j] = 0.0
            for k in range(3):
                off[i, j] += d.rotation[i, k] * tip_rotation[j, k]
    logarithm(off, turn)
    for i in range(3):
        residual[3 + i] = turn[i]
        for a in range(MODES):
            rows[i, a] = -jacobian[i, a]
            rows[3 + i, a] = -jacobian[3 + i, a]
    _weigh(rows, residual, 0, 3, p.position_deviation)
    _weigh(rows, residual, 3, 3, p.angle_deviation)
    lengths = np.empty(4)
    tendon_lengths_of_modes(z, p.pitch_radius, p.chord, lengths)
    for i in range(4):
        residual[6 + i] = d.lengths[i] - lengths[i]
        for a in range(TWIST):
            rows[6 + i, a] = 2.0 * p.chord * NORMS[a] * z[a]
    rows[6, ORDERS] += p.pitch_radius
    rows[8, ORDERS] -= p.pitch_radius
    rows[7, 0] -= p.pitch_radius
    rows[9, 0] += p.pitch_radius
    _weigh(rows, residual, 6, 4, p.length_deviation)
    offset = np.empty(3)
    for i in range(3):
        offset[i] = -p.contact_offset * tip_rotation[i, 2]
    _balance(y, p, rotations, axes, positions, tip_position, offset, jacobian, residual, rows)
    _weigh(rows, residual, _BALANCE, MODES, p.balance_deviation)
    _known_before(y, d, p, residual, rows)


@compiled
def _balance(
    y: np.ndarray,
    p: RecordFields,
    rotations: np.ndarray,
    axes: np.ndarray,
    positions: np.ndarray,
    tip_position: np.ndarray,
    offset: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    rows: np.ndarray,
) -> None:
    """Rows 10 to 20: elastic forces less those of tendons and tip force, mode by mode, N m."""
    force, per_mode = np.empty(MODES), np.empty((MODES, MODES))
    per_tension, per_sliding = np.empty((MODES, 4)), np.empty((MODES, 4))
    per_level, stiffening = np.empty(MODES), np.empty((MODES, MODES))
    friction = (p.friction, p.coulomb, y[LEVEL])
    tendon_forces(
        y[:MODES], y[TENSION:STIFFNESS], y[SLIDING:], friction, (p.pitch_radius, p.length, p.chord),
        force, per_mode, per_tension, per_sliding, per_level,
    )  # fmt: skip
    tip_force, lever = y[FORCE:TENSION], np.empty(3)
    force_stiffness(
        rotations, axes, positions, tip_position, offset, p.length, tip_force, stiffening
    )
    for a in range(MODES):
        row = _BALANCE + a
        bends = a < TWIST
        stiffness = (p.bending_stiffness if bends else p.torsion_stiffness) * NORMS[a] / p.length
        share = 1.0 + y[STIFFNESS]
        residual[row] = share * stiffness * y[a] - force[a]
        turn = jacobian[3:, a]
        lever[0] = jacobian[0, a] + turn[1] * offset[2] - turn[2] * offset[1]
        lever[1] = jacobian[1, a] + turn[2] * offset[0] - turn[0] * offset[2]
        lever[2] = jacobian[2, a] + turn[0] * offset[1] - turn[1] * offset[0]
        for k in range(3):
            residual[row] -= lever[k] * tip_force[k]
            rows[row, FORCE + k] = -lever[k]
        for b in range(MODES):
            rows[row, b] = -per_mode[a, b] - stiffening[a, b]
        rows[row, a] += share * stiffness
        rows[row, STIFFNESS] = stiffness * y[a]
        rows[row, LEVEL] = -per_level[a]
        for i in range(4):
            rows[row, TENSION + i] = -per_tension[a, i]
            rows[row, SLIDING + i] = -per_sliding[a, i]


@compiled
def _known_before(
    y: np.ndarray, d: RecordFields, p: RecordFields, residual: np.ndarray, rows: np.ndarray
) -> None:
    """Rows 21 to 33: tensions, force, stiffness, friction and sliding as known beforehand."""
    for i in range(4):
        residual[_BEFORE + i] = (y[TENSION + i] - d.tensions[i]) / p.tension_deviation
        rows[_BEFORE + i, TENSION + i] = 1.0 / p.tension_deviation
        residual[_BEFORE + 9 + i] = (y[SLIDING + i] - d.sliding[i]) / p.sliding_deviation
        rows[_BEFORE + 9 + i, SLIDING + i] = 1.0 / p.sliding_deviation
    for i in range(3):
        for k in range(3):
            residual[_BEFORE + 4 + i] += d.force_weight[i, k] * (y[FORCE + k] - d.force[k])
            rows[_BEFORE + 4 + i, FORCE + k] = d.force_weight[i, k]
    residual[_BEFORE + 7] = y[STIFFNESS] / p.stiffness_deviation
    rows[_BEFORE + 7, STIFFNESS] = 1.0 / p.stiffness_deviation
    residual[_BEFORE + 8] = (y[LEVEL] - 1.0) / p.friction_deviation
    rows[_BEFORE + 8, LEVEL] = 1.0 / p.friction_deviation


@compiled
def _factor(matrix: np.ndarray) -> bool:
    """Cholesky factor in the lower triangle of ``matrix``; False where it is not definite."""
    size = matrix.shape[0]
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                matrix[i, i] = math.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    return True


@compiled
def _solve(factor: np.ndarray, x: np.ndarray) -> None:
    """Replace ``x`` by the solution of factor factor^T x = x."""
    size = x.size
    for i in range(size):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            x[i] -= factor[k, i] * x[k]
        x[i] /= factor[i, i]


@compiled
def _start(sample: np.ndarray, model: np.ndarray, y: np.ndarray) -> None:
    """Constant curvature after the tendons, which know the bend also where it is large."""
    d, r = sample[0], model[0].pitch_radius
    y[:] = 0.0
    y[0] = 0.5 * (d.lengths[1] - d.lengths[3]) / r
    y[ORDERS] = 0.5 * (d.lengths[2] - d.lengths[0]) / r
    for i in range(3):
        y[FORCE + i] = d.force[i]
    for i in range(4):
        y[TENSION + i] = d.tensions[i]
        y[SLIDING + i] = d.sliding[i]
    y[LEVEL] = 1.0


@compiled
def _normal(rows: np.ndarray, residual: np.ndarray, matrix: np.ndarray, right: np.ndarray) -> None:
    """Lower triangle of rows^T rows, and -rows^T residual."""
    matrix[:], right[:] = 0.0, 0.0
    for i in range(_ROWS):
        for a in range(UNKNOWNS):
            value = rows[i, a]
            if value == 0.0:
                continue
            right[a] -= value * residual[i]
            for b in range(a + 1):
                matrix[a, b] += value * rows[i, b]


@compiled
def estimate(sample: np.ndarray, model: np.ndarray, out: np.ndarray) -> None:
    """Estimate shape and force of one sample, from nothing else.

    Args:
        sample: (1,) ``SAMPLE``.
        model: (1,) ``MODEL``.
        out: (1,) ``ESTIMATE``, filled; not settled where a number is not finite or the search does
            not end.
    """
    e = out[0]
    y, step, right = np.empty(UNKNOWNS), np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    residual, rows = np.empty(_ROWS), np.empty((_ROWS, UNKNOWNS))
    matrix = np.empty((UNKNOWNS, UNKNOWNS))
    _start(sample, model, y)
    e.settled, e.steps = 0, 0
    for count in range(_MOST_STEPS):
        residuals(y, sample, model, e.position, e.rotation, residual, rows)
        _normal(rows, residual, matrix, right)
        if not _factor(matrix):
            return
        step[:] = right
        _solve(matrix, step)
        largest, size = 0.0, 0.0
        for a in range(UNKNOWNS):
            if a < MODES:
                largest = max(largest, abs(step[a]))
            size += step[a] * right[a]
        if not math.isfinite(size):
            return
        share = min(1.0, _LARGEST_TURN / largest) if largest > 0.0 else 1.0
        for a in range(UNKNOWNS):
            y[a] += share * step[a]
        e.steps = count + 1
        if size < _SETTLED and share == 1.0:
            e.settled = 1
            break
    e.unknowns[:] = y
    _conclude(residual, matrix, out)


@compiled
def _conclude(residual: np.ndarray, factor: np.ndarray, out: np.ndarray) -> None:
    """Covariance and misfits."""
    e = out[0]
    column = np.empty(UNKNOWNS)
    for a in range(UNKNOWNS):
        column[:] = 0.0
        column[a] = 1.0
        _solve(factor, column)
        e.covariance[a] = column
    e.pose_misfit, e.length_misfit, e.misfit = 0.0, 0.0, 0.0
    for i in range(_ROWS):
        square = residual[i] * residual[i]
        e.misfit += square
        if i < 6:
            e.pose_misfit += square
        elif i < 10:
            e.length_misfit += square


def force_weight(axis: np.ndarray | None, deviation: float, aside: float) -> np.ndarray:
    """What is known of the force beforehand, as ``SAMPLE`` wants it.

    Args:
        axis: (3,) direction along which contact pushes, in the segment's base frame; None where
            nothing is known of it.
        deviation: standard deviation of the force along the axis, N.
        aside: across the axis, N; without an axis it counts for nothing.

    Returns:
        (3, 3) inverse of a root of the covariance, 1/N.
    """
    if axis is None:
        return np.eye(3) / deviation
    n = np.asarray(axis, float) / np.linalg.norm(axis)
    along = np.outer(n, n)
    return np.asarray(along / deviation + (np.eye(3) - along) / aside)
