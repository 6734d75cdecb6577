"""The shape S = (m0, m1, m2, delta) that gives a measured pose of the tip.

Paper 3 minimises the Frobenius norm of the difference of the two transforms, eq. (38), by a
quasi-Newton method. That counts metres and radians alike, and since adding (1/6, -1, 1) to m hardly
moves the tip, the shape it finds may be another one that gives the same pose: for an arc of 45 deg
the one with 33 (1/6, -1, 1) more, and 10.8 times its energy.

Here positions and angles count in their standard deviations, which for a tracker of 0.25 mm and
0.5 deg is nearly the same as positions over the segment's length; the energy keeps m1 and m2 small,
as normal variables do of a given standard deviation; and the search, Levenberg and Marquardt's with
the analytic Jacobian, starts from the arc that fits best.

Below some five degrees two shapes of nearly the same energy can give a pose exactly: the curvature
changes sign, and the height of the tip only knows the square of how much. Without noise the search
may take more than ten steps there and end at either; with noise the energy decides between them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robot.compiled import compiled
from robot.errors import KeyholeError
from robot.rotations import logarithm
from robot.sensing.constant_curvature import (
    SETTLED,
    fit_arc,
    pose_difference,
    refuse_what_is_no_pose,
    weighted_square,
)
from robot.sensing.polynomial_curvature import STATES, make_canonical, tip_jacobian, tip_pose

ITERATIONS = 30
LOOSE, LOOSELY_SETTLED = 0.01, 1.0
"""The search first takes positions (over the length) and angles (rad) as no better than this, so
that the energy decides between shapes that give nearly the same pose; to this change of the sum."""
_POSSIBLE = 0.2
"""Share of the length that a bend in one plane may leave of the position before the pose counts as
impossible; contact of 0.5 N out of the plane of a 0.5 mm rod leaves up to 0.15..."""
_POSSIBLE_RAD = math.radians(20.0)
"""...and this of the rotation, of which it leaves up to 11 deg."""
_POSSIBLE_MODES = 20.0
"""Largest m1 or m2 in standard deviations; 0.5 N across that rod makes m1 2.4 rad."""
_LONGER = 5.0
"""Standard deviations by which the chord may measure more than the length."""


class PoseDeviations(NamedTuple):
    """Standard deviations of what is known before and of what is measured.

    Attributes:
        position: of each coordinate of the tip's position, m.
        rotation: of the tip's rotation about each axis, rad.
        modes: of m1 and m2, rad.
    """

    position: float = 0.25e-3
    rotation: float = math.radians(0.5)
    modes: float = 0.3


class ShapeFit(NamedTuple):
    """A shape fitted to a pose of the tip.

    Attributes:
        shape: (4,) S = (m0, m1, m2, delta), rad, with a bend of 0 or more.
        iterations: how many it took.
        residual: (6,) position (m) and rotation vector (rad) of what was measured, seen from what
            was fitted, segment base frame.
        converged: whether it settled.
    """

    shape: np.ndarray
    iterations: int
    residual: np.ndarray
    converged: bool


class ImpossiblePose(KeyholeError):
    """No bend of the segment comes near the measured pose of its tip.

    Attributes:
        position_error_m: what the best bend leaves of the position.
        rotation_error_rad: what it leaves of the rotation.
    """

    code = "impossible_pose"

    def __init__(self, position_error_m: float, rotation_error_rad: float) -> None:
        super().__init__(
            "no bend of the segment gives the measured pose of its tip: "
            f"{position_error_m * 1e3:.1f} mm and {math.degrees(rotation_error_rad):.1f} deg "
            "remain; check the tracker's registration and its marker"
        )
        self.position_error_m = position_error_m
        self.rotation_error_rad = rotation_error_rad


@compiled
def _difference(
    shape: np.ndarray, position: np.ndarray, rotation: np.ndarray, length: float, out: np.ndarray
) -> None:
    there, turned = np.empty(3), np.empty((3, 3))
    tip_pose(shape, length, there, turned)
    pose_difference(position, rotation, there, turned, out)


@compiled
def _square(
    shape: np.ndarray, residual: np.ndarray, deviations: tuple[float, float, float]
) -> float:
    modes = (shape[1] * shape[1] + shape[2] * shape[2]) / deviations[2] ** 2
    return float(weighted_square(residual, (deviations[0], deviations[1])) + modes)


@compiled
def _linearize(
    shape: np.ndarray,
    residual: np.ndarray,
    length: float,
    deviations: tuple[float, float, float],
    normal: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Normal matrix (4, 4) and right side (4,) of the step that lessens the sum of squares.

    The rotation vector's own Jacobian leaves the vector as it is, so the right side is exact.
    """
    columns = np.empty((6, STATES))
    tip_jacobian(shape, length, columns)
    normal[:], slope[:] = 0.0, 0.0
    for i in range(6):
        w = 1.0 / deviations[i // 3] ** 2
        for a in range(STATES):
            slope[a] += w * columns[i, a] * residual[i]
            for b in range(STATES):
                normal[a, b] += w * columns[i, a] * columns[i, b]
    for a in range(1, 3):
        normal[a, a] += 1.0 / deviations[2] ** 2
        slope[a] -= shape[a] / deviations[2] ** 2
    _add_turn_of_direction(shape, residual, columns, deviations, normal)


@compiled
def _add_turn_of_direction(
    shape: np.ndarray,
    residual: np.ndarray,
    columns: np.ndarray,
    deviations: tuple[float, float, float],
    normal: np.ndarray,
) -> None:
    """Add how delta turns the other columns and its own, times what is left of the pose.

    As delta turns, tip and columns go around circles. Where the segment is nearly straight the
    circles are as small as the noise, and without this the search would creep. What is added for
    the rotation is exact for small bends, where it counts.
    """
    x, y = math.cos(shape[3]), -math.sin(shape[3])
    w, v = 1.0 / deviations[0] ** 2, 1.0 / deviations[1] ** 2
    along, across = w * (residual[0] * x + residual[1] * y), w * (residual[0] * y - residual[1] * x)
    about = v * (residual[4] * x - residual[3] * y)
    aside = v * (residual[3] * x + residual[4] * y)
    for k in range(3):
        reach = columns[0, k] * x + columns[1, k] * y
        normal[k, 3] -= across * reach + aside / (k + 1.0)
        normal[3, k] = normal[k, 3]
    normal[3, 3] += along * (columns[0, 3] * y - columns[1, 3] * x)
    normal[3, 3] += about * (columns[3, 3] * x + columns[4, 3] * y)


@compiled
def _damped_step(
    normal: np.ndarray, slope: np.ndarray, damping: float, step: np.ndarray, factor: np.ndarray
) -> bool:
    """Solve for ``step`` (4,) with a share of the diagonal added, by Cholesky's ``factor`` (4, 4).

    delta may change nothing at all, so what is added to it depends on the others.

    Returns:
        Whether the matrix is definite; if not, the step is not to be used.
    """
    least = 0.0
    for a in range(STATES):
        least = max(least, 1e-6 * abs(normal[a, a]))
    for a in range(STATES):
        for b in range(a + 1):
            total = normal[a, b]
            if a == b:
                total += damping * max(abs(normal[a, a]), least)
            for k in range(b):
                total -= factor[a, k] * factor[b, k]
            if a != b:
                factor[a, b] = total / factor[b, b]
            elif total > 0.0:
                factor[a, a] = math.sqrt(total)
            else:
                return False
    for a in range(STATES):
        step[a] = slope[a]
        for k in range(a):
            step[a] -= factor[a, k] * step[k]
        step[a] /= factor[a, a]
    for a in range(STATES - 1, -1, -1):
        for k in range(a + 1, STATES):
            step[a] -= factor[k, a] * step[k]
        step[a] /= factor[a, a]
    return True


@compiled
def _start_from_arc(
    position: np.ndarray,
    rotation: np.ndarray,
    bend: np.ndarray,
    deviations: tuple[float, float, float],
    shape: np.ndarray,
) -> None:
    """The arc, turned into the plane that holds most of the tip's deflection and of its lean.

    Where these two oppose each other, the arc that fits best lies in any plane.
    """
    turn = np.empty(3)
    logarithm(rotation, turn)
    px, py = position[0] / deviations[0], position[1] / deviations[0]
    tx, ty = turn[1] / deviations[1], -turn[0] / deviations[1]
    axis = 0.5 * math.atan2(2.0 * (px * py + tx * ty), px * px + tx * tx - py * py - ty * ty)
    shape[0] = bend[0] * math.cos(axis) - bend[1] * math.sin(axis)
    shape[1], shape[2], shape[3] = 0.0, 0.0, -axis
    make_canonical(shape)


@compiled
def _search(
    position: np.ndarray,
    rotation: np.ndarray,
    length: float,
    deviations: tuple[float, float, float],
    first: bool,
    shape: np.ndarray,
    residual: np.ndarray,
) -> tuple[int, bool]:
    """Levenberg-Marquardt from ``shape``: the iterations, and whether it settled.

    The ``first`` search need not settle closely, and its first step holds delta: where m is next to
    nothing delta has no slope worth following.
    """
    enough = LOOSELY_SETTLED if first else SETTLED
    off, trial = np.empty(6), np.empty(STATES)
    _difference(shape, position, rotation, length, residual)
    square, damping = _square(shape, residual, deviations), 1e-9
    if not math.isfinite(square):
        return 0, False
    normal, slope = np.empty((STATES, STATES)), np.empty(STATES)
    factor, step = np.empty((STATES, STATES)), np.empty(STATES)
    for iteration in range(1, ITERATIONS + 1):
        _linearize(shape, residual, length, deviations, normal, slope)
        if first and iteration == 1:
            slope[3] = 0.0
            for a in range(3):
                normal[3, a], normal[a, 3] = 0.0, 0.0
            normal[3, 3] = 1.0
        if not _damped_step(normal, slope, damping, step, factor):
            damping = max(100.0 * damping, 1e-4)
            continue
        gained = 0.0
        for a in range(STATES):
            trial[a] = shape[a] + step[a]
            gained += step[a] * slope[a]
        _difference(trial, position, rotation, length, off)
        there = _square(trial, off, deviations)
        if there <= square:
            for a in range(STATES):
                shape[a] = trial[a]
            for i in range(6):
                residual[i] = off[i]
            square, damping = there, max(0.1 * damping, 1e-9)
        else:
            damping = max(100.0 * damping, 1e-4)
        if gained < enough:
            return iteration, True
    return ITERATIONS, False


@compiled
def fit_shape(
    position: np.ndarray,
    rotation: np.ndarray,
    length: float,
    deviations: tuple[float, float, float],
    shape: np.ndarray,
    residual: np.ndarray,
) -> tuple[int, bool]:
    """Fit S to a pose of the tip, from the arc that fits best.

    Args:
        position: (3,) of the tip, m, segment base frame.
        rotation: (3, 3) of the tip.
        length: of the segment, m.
        deviations: of position (m), rotation (rad), m1 and m2 (rad).
        shape: (4,) filled.
        residual: (6,) filled, see ``ShapeFit``.

    Returns:
        The iterations, and whether it settled.
    """
    bend, loose = np.empty(2), (max(deviations[0], LOOSE * length), max(deviations[1], LOOSE))
    fit_arc(position, rotation, length, (deviations[0], deviations[1]), bend, residual)
    _start_from_arc(position, rotation, bend, deviations, shape)
    near = (loose[0], loose[1], deviations[2])
    first, _ = _search(position, rotation, length, near, True, shape, residual)
    more, settled = _search(position, rotation, length, deviations, False, shape, residual)
    make_canonical(shape)
    return first + more, settled


@compiled
def is_possible(
    position: np.ndarray,
    fitted: np.ndarray,
    residual: np.ndarray,
    length: float,
    deviations: tuple[float, float, float],
) -> bool:
    """Whether a fit, ``fitted`` (4,) and ``residual`` (6,), is what contact and noise can make.

    Args:
        position: (3,) of the tip, m, segment base frame.
        fitted: (4,) S.
        residual: (6,) what it leaves of the pose, m and rad.
        length: of the segment, m.
        deviations: of position (m), rotation (rad), m1 and m2 (rad).
    """
    chord, off, turn = 0.0, 0.0, 0.0
    for i in range(3):
        chord += position[i] * position[i]
        off += residual[i] * residual[i]
        turn += residual[3 + i] * residual[3 + i]
    longest = length + _LONGER * deviations[0]
    near = off <= (_POSSIBLE * length) ** 2 and turn <= _POSSIBLE_RAD**2
    smooth = max(abs(fitted[1]), abs(fitted[2])) <= _POSSIBLE_MODES * deviations[2]
    return bool(near and smooth and chord <= longest * longest)


def shape_from_pose(
    position: np.ndarray,
    rotation: np.ndarray,
    length: float,
    deviations: PoseDeviations = PoseDeviations(),  # noqa: B008 - it cannot be changed
) -> ShapeFit:
    """The shape that gives a pose of the tip, found without a first guess.

    Args:
        position: (3,) of the tip, m, segment base frame.
        rotation: (3, 3) of the tip.
        length: of the segment, m.
        deviations: standard deviations of the pose, and of m1 and m2; all above 0.

    Raises:
        InvalidPose: a value is not finite or the matrix is no rotation.
        ImpossiblePose: no bend comes near the pose.
    """
    position, rotation = np.asarray(position, dtype=float), np.asarray(rotation, dtype=float)
    refuse_what_is_no_pose(position, rotation)
    shape, residual = np.empty(STATES), np.empty(6)
    given = (float(deviations[0]), float(deviations[1]), float(deviations[2]))
    turned = np.ascontiguousarray(rotation)
    iterations, converged = fit_shape(position, turned, length, given, shape, residual)
    if not is_possible(position, shape, residual, length, given):
        off, turn = np.linalg.norm(residual[:3]), np.linalg.norm(residual[3:])
        raise ImpossiblePose(float(off), float(turn))
    return ShapeFit(shape, iterations, residual, converged)
