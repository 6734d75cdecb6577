"""Kinematics of arm and instrument together: tip, shaft, RCM and their Jacobians.

The augmented configuration is x = [q (7), u, v, lambda]. Source: paper 1, eqs. (23)-(46), with
p_ee read as the shaft base (a point on the shaft's axis), not the origin of frame 7, and p_rcm in
R^3.
"""

from __future__ import annotations

import numpy as np

from robot.compiled import compiled
from robot.rotations import apply, multiply
from robot.segment import jacobian as segment_jacobian
from robot.segment import tip_position, tip_rotation

ROWS = 10
RCM_ROWS, LINEAR_ROWS, POINTING_ROWS, ROLL_ROWS, LAMBDA_ROWS = (
    range(3),
    range(3, 6),
    range(6, 8),
    range(8, 9),
    range(9, 10),
)
"""Places in the catalogue of task rows: RCM x, y, z and tip linear x, y, z in the base frame; tip
angular about the tip's own x and y (pointing) and z (roll); lambda."""


@compiled
def shaft(
    arm_position: np.ndarray,
    arm_rotation: np.ndarray,
    parameters: np.ndarray,
    base: np.ndarray,
    end: np.ndarray,
    rotation: np.ndarray,
) -> None:
    """Shaft base and end (3,), m, and the segment's base frame (3, 3), all in the base frame."""
    p = parameters[0]
    multiply(arm_rotation, p.rotation_flange_segment, rotation)
    apply(arm_rotation, p.shaft_base, base)
    for i in range(3):
        base[i] += arm_position[i]
        end[i] = base[i] + p.shaft_length * rotation[i, 2]


@compiled
def tip(
    shaft_end: np.ndarray,
    shaft_rotation: np.ndarray,
    u: float,
    v: float,
    segment_length: float,
    position: np.ndarray,
    rotation: np.ndarray,
) -> None:
    """Tip position (3,), m, and rotation (3, 3) in the base frame."""
    local_position = np.empty(3)
    local_rotation = np.empty((3, 3))
    tip_position(u, v, segment_length, local_position)
    tip_rotation(u, v, local_rotation)
    apply(shaft_rotation, local_position, position)
    for i in range(3):
        position[i] += shaft_end[i]
    multiply(shaft_rotation, local_rotation, rotation)


@compiled
def point_rates(arm_jacobian: np.ndarray, point: np.ndarray, out: np.ndarray) -> None:
    """Linear velocity of ``point`` (3,), m, moving with frame 7, per joint rate: out (3, 7)."""
    for j in range(7):
        wx, wy, wz = arm_jacobian[3, j], arm_jacobian[4, j], arm_jacobian[5, j]
        out[0, j] = arm_jacobian[0, j] + wy * point[2] - wz * point[1]
        out[1, j] = arm_jacobian[1, j] + wz * point[0] - wx * point[2]
        out[2, j] = arm_jacobian[2, j] + wx * point[1] - wy * point[0]


@compiled
def tip_jacobian(
    arm_jacobian: np.ndarray,
    shaft_rotation: np.ndarray,
    position: np.ndarray,
    u: float,
    v: float,
    segment_length: float,
    out: np.ndarray,
) -> None:
    """Tip twist per rate of x, base frame: out (6, 10), rows linear then angular; eqs. (38)-(48).

    Args:
        arm_jacobian: (6, 7) as in :class:`robot.arm.Arm`.
        shaft_rotation: (3, 3) segment base frame in the base frame.
        position: (3,) tip in the base frame, m.
        u: first segment coordinate, rad.
        v: second segment coordinate, rad.
        segment_length: m.
        out: (6, 10) filled; the last column (lambda) is zero.
    """
    point_rates(arm_jacobian, position, out[:3])
    for i in range(3):
        for j in range(7):
            out[3 + i, j] = arm_jacobian[3 + i, j]
    local = np.empty((6, 2))
    segment_jacobian(u, v, segment_length, local)
    for i in range(3):
        for j in range(2):
            linear = 0.0
            angular = 0.0
            for k in range(3):
                linear += shaft_rotation[i, k] * local[k, j]
                angular += shaft_rotation[i, k] * local[3 + k, j]
            out[i, 7 + j] = linear
            out[3 + i, 7 + j] = angular
        out[i, 9] = 0.0
        out[3 + i, 9] = 0.0


@compiled
def rcm_jacobian(
    arm_jacobian: np.ndarray,
    shaft_base: np.ndarray,
    shaft_end: np.ndarray,
    lambda_along_shaft: float,
    out: np.ndarray,
) -> None:
    """Velocity of the shaft's point at lambda per rate of x: out (3, 10); eqs. (23)-(29).

    The point is p_ee + lambda (p_ins - p_ee); its last column is the shaft vector d_ins.
    """
    point = np.empty(3)
    for i in range(3):
        point[i] = shaft_base[i] + lambda_along_shaft * (shaft_end[i] - shaft_base[i])
    point_rates(arm_jacobian, point, out)
    for i in range(3):
        out[i, 7] = 0.0
        out[i, 8] = 0.0
        out[i, 9] = shaft_end[i] - shaft_base[i]


@compiled
def project_on_shaft(
    point: np.ndarray, shaft_base: np.ndarray, shaft_end: np.ndarray
) -> tuple[float, float]:
    """Where ``point`` (3,), m, stands along the shaft (0 base, 1 end); its distance from it, m."""
    length_squared = 0.0
    along = 0.0
    for i in range(3):
        d = shaft_end[i] - shaft_base[i]
        length_squared += d * d
        along += d * (point[i] - shaft_base[i])
    fraction = along / length_squared
    square = 0.0
    for i in range(3):
        difference = point[i] - shaft_base[i] - fraction * (shaft_end[i] - shaft_base[i])
        square += difference * difference
    return fraction, np.sqrt(square)
