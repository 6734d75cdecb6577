"""The counterpart of polynomial curvature: the segment an arc, its shape and force.

The state is the bend (u, v) of :mod:`robot.segment`, which stays smooth where the segment is
straight. Free of contact and friction a segment is exactly an arc, and two unknowns carry less
noise than four; in contact and under friction it is none. Its balance has two equations: of a force
it sees two components at most.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robot.compiled import compiled
from robot.errors import InvalidPose
from robot.rotations import logarithm, multiply_transposed
from robot.segment import jacobian, tip_position, tip_rotation
from robot.sensing.virtual_work import Balance, SegmentModel, TendonLoad, plain

ITERATIONS = 20
SETTLED = 1e-8
"""Change of the sum of squares, in standard deviations squared, below which a fit has settled."""


class ArcFit(NamedTuple):
    """An arc fitted to a pose of the tip.

    Attributes:
        bend: (2,) u, v, rad.
        iterations: how many it took.
        residual: (6,) position (m) and rotation vector (rad) of what was measured, seen from what
            was fitted, segment base frame.
        converged: whether it settled.
    """

    bend: np.ndarray
    iterations: int
    residual: np.ndarray
    converged: bool


@compiled
def pose_difference(
    position: np.ndarray,
    rotation: np.ndarray,
    fitted_position: np.ndarray,
    fitted_rotation: np.ndarray,
    out: np.ndarray,
) -> None:
    """What the first pose is off the second: ``out`` (6,), m and a rotation vector, base frame."""
    relative, vector = np.empty((3, 3)), np.empty(3)
    multiply_transposed(rotation, fitted_rotation, relative)
    logarithm(relative, vector)
    for i in range(3):
        out[i] = position[i] - fitted_position[i]
        out[3 + i] = vector[i]


@compiled
def weighted_square(residual: np.ndarray, deviations: tuple[float, float]) -> float:
    """Sum of squares of a pose's ``residual`` (6,) in standard deviations of m and rad."""
    total = 0.0
    for i in range(6):
        total += (residual[i] / deviations[i // 3]) ** 2
    return float(total)


@compiled
def _arc_difference(
    bend: np.ndarray, position: np.ndarray, rotation: np.ndarray, length: float, out: np.ndarray
) -> None:
    there, turned = np.empty(3), np.empty((3, 3))
    tip_position(bend[0], bend[1], length, there)
    tip_rotation(bend[0], bend[1], turned)
    pose_difference(position, rotation, there, turned, out)


@compiled
def fit_arc(
    position: np.ndarray,
    rotation: np.ndarray,
    length: float,
    deviations: tuple[float, float],
    bend: np.ndarray,
    residual: np.ndarray,
) -> tuple[int, bool]:
    """Fit an arc to a pose of the tip: Levenberg-Marquardt from the pose's rotation vector.

    Args:
        position: (3,) of the tip, m, segment base frame.
        rotation: (3, 3) of the tip.
        length: of the segment, m.
        deviations: of each coordinate of the position (m) and of the rotation (rad).
        bend: (2,) filled with u, v, rad.
        residual: (6,) filled, see ``ArcFit``.

    Returns:
        The iterations, and whether it settled.
    """
    columns, trial, off, turn = np.empty((6, 2)), np.empty(2), np.empty(6), np.empty(3)
    logarithm(rotation, turn)
    bend[0], bend[1] = turn[1], turn[0]
    _arc_difference(bend, position, rotation, length, residual)
    square, damping = weighted_square(residual, deviations), 1e-6
    for iteration in range(1, ITERATIONS + 1):
        jacobian(bend[0], bend[1], length, columns)
        uu, uv, vv, gu, gv = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(6):
            w = 1.0 / deviations[i // 3] ** 2
            uu += w * columns[i, 0] * columns[i, 0]
            uv += w * columns[i, 0] * columns[i, 1]
            vv += w * columns[i, 1] * columns[i, 1]
            gu += w * columns[i, 0] * residual[i]
            gv += w * columns[i, 1] * residual[i]
        uu, vv = uu * (1.0 + damping), vv * (1.0 + damping)
        size = uu * vv - uv * uv
        du, dv = (vv * gu - uv * gv) / size, (uu * gv - uv * gu) / size
        trial[0], trial[1] = bend[0] + du, bend[1] + dv
        _arc_difference(trial, position, rotation, length, off)
        there = weighted_square(off, deviations)
        if there <= square:
            bend[0], bend[1] = trial[0], trial[1]
            for i in range(6):
                residual[i] = off[i]
            square, damping = there, 0.1 * damping
        else:
            damping = max(100.0 * damping, 1e-3)
        if du * gu + dv * gv < SETTLED:
            return iteration, True
    return ITERATIONS, False


def arc_from_pose(
    position: np.ndarray,
    rotation: np.ndarray,
    length: float,
    deviations: tuple[float, float] = (0.25e-3, math.radians(0.5)),
) -> ArcFit:
    """The arc that comes nearest to a pose of the tip.

    Args:
        position: (3,) of the tip, m, segment base frame.
        rotation: (3, 3) of the tip.
        length: of the segment, m.
        deviations: of each coordinate of the position (m) and of the rotation (rad), above 0.

    Raises:
        InvalidPose: a value is not finite or the matrix is no rotation.
    """
    position, rotation = np.asarray(position, dtype=float), np.asarray(rotation, dtype=float)
    refuse_what_is_no_pose(position, rotation)
    bend, residual = np.empty(2), np.empty(6)
    turned = np.ascontiguousarray(rotation)
    given = (float(deviations[0]), float(deviations[1]))
    iterations, converged = fit_arc(position, turned, length, given, bend, residual)
    return ArcFit(bend, iterations, residual, converged)


def refuse_what_is_no_pose(position: np.ndarray, rotation: np.ndarray) -> None:
    """Raise ``InvalidPose`` where a value is not finite or ``rotation`` (3, 3) is no rotation."""
    if not (np.isfinite(position).all() and np.isfinite(rotation).all()):
        raise InvalidPose("pose of the tip", "a value is not finite")
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0.0:
        raise InvalidPose("pose of the tip", "the matrix is no rotation; orthonormalize it")


@compiled
def fill_arc_balance(
    bend: np.ndarray,
    segment: tuple[float, float, float],
    tensions: np.ndarray,
    sliding: np.ndarray,
    friction: tuple[float, float],
    columns: np.ndarray,
    missing: np.ndarray,
) -> None:
    """The balance of an arc in (u, v): the one of S with m1 = m2 = 0, without its weak directions.

    Along an arc bent by phi, friction leaves of a tension the mean
    (tau - f c) (1 - exp(-f mu phi)) / (f mu phi).

    Args:
        bend: (2,) u, v, rad.
        segment: length (m), pitch radius (m), EI (N m^2).
        tensions: (4,) at the base, N.
        sliding: (4,) shares.
        friction: mu, and c in N.
        columns: (6, 2) filled.
        missing: (2,) filled, N m.
    """
    length, pitch_radius, stiffness = segment
    mu, coulomb = friction
    phi = math.hypot(bend[0], bend[1])
    pulled = np.empty(4)
    for i in range(4):
        wrapped = sliding[i] * mu * phi
        mean = 1.0 if wrapped == 0.0 else -math.expm1(-wrapped) / wrapped
        pulled[i] = (tensions[i] - sliding[i] * coulomb) * mean
    missing[0] = stiffness / length * bend[0] - pitch_radius * (pulled[0] - pulled[2])
    missing[1] = stiffness / length * bend[1] - pitch_radius * (pulled[3] - pulled[1])
    jacobian(bend[0], bend[1], length, columns)


def arc_balance(bend: np.ndarray, segment: SegmentModel, load: TendonLoad) -> Balance:
    """The balance of the arc ``bend`` (2,), for what :mod:`robot.sensing.virtual_work` solves."""
    columns, missing = np.empty((6, 2)), np.empty(2)
    fill_arc_balance(np.asarray(bend, dtype=float), *plain(segment, load), columns, missing)
    return Balance(columns, missing, segment.length)
