"""Resolved rates: from the pose error to the tip twist. Paper 1, eqs. (92)-(101).

Corrections: the switch of (97), (98) is at ``|e| > epsilon * gamma`` (print: epsilon / gamma), so
that chi of (99) runs from 0 at gamma to 1 at epsilon * gamma and the speed has no step; the
orientation error is the SO(3) logarithm instead of (95), (96), which fail at 0 and pi.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.rotations import logarithm, multiply_transposed


@compiled
def resolved_speed(
    error: float, speed_max: float, speed_min: float, threshold: float, ramp: float
) -> float:
    """Speed for an error of norm ``error``; eqs. (97)-(99), zero below the threshold.

    Args:
        error: norm of the error, m or rad.
        speed_max: speed beyond the ramp, m/s or rad/s.
        speed_min: speed at the threshold, m/s or rad/s.
        threshold: gamma, m or rad.
        ramp: epsilon > 1; the ramp ends at epsilon * gamma.
    """
    if error <= threshold:
        return 0.0
    if error > ramp * threshold:
        return speed_max
    chi = (error - threshold) / (threshold * (ramp - 1.0))
    return speed_min + (speed_max - speed_min) * chi


@compiled
def correction_gains(
    distance: float, angle: float, together: bool, parameters: np.ndarray
) -> tuple[float, float]:
    """Gains (1/s) of the correction that goes with feed-forward: the same ramp, no dead zone.

    Args:
        distance: norm of the position error, m.
        angle: norm of the orientation error, rad.
        together: whether linear and angular commands share a level. Then a saturated one slows the
            other down as much: saturating them apart would turn the weighted error that this level
            minimises into another one.
        parameters: (1,) ``robot.parameters.PARAMETERS``.
    """
    p = parameters[0]
    linear = p.speed_max / max(distance, p.position_ramp * p.position_threshold)
    angular = p.angular_speed_max / max(angle, p.orientation_ramp * p.orientation_threshold)
    if together:
        linear = angular = min(linear, angular)
    return linear, angular


@compiled
def rotation_error(desired: np.ndarray, current: np.ndarray, out: np.ndarray) -> float:
    """Rotation vector (3,) in the base frame that takes ``current`` to ``desired``; its angle."""
    relative = np.empty((3, 3))
    multiply_transposed(desired, current, relative)
    return logarithm(relative, out)


@compiled
def tip_twist(
    desired_position: np.ndarray,
    desired_rotation: np.ndarray,
    previous_position: np.ndarray,
    previous_rotation: np.ndarray,
    tip_position: np.ndarray,
    tip_rotation: np.ndarray,
    dt: float,
    feed_forward: bool,
    together: bool,
    parameters: np.ndarray,
    out: np.ndarray,
) -> None:
    """Twist that the tip shall have during the coming ``dt``.

    With feed-forward, the desired pose's own motion since the last tick is added to a correction of
    what was left over then, so that after the tick the tip stands at the desired pose. Without, it
    is the paper's law on the present error.

    Args:
        desired_position: (3,) where the tip shall be after this tick, base frame, m.
        desired_rotation: (3, 3) likewise.
        previous_position: (3,) the same of the last tick.
        previous_rotation: (3, 3) the same of the last tick.
        tip_position: (3,) commanded tip now, m.
        tip_rotation: (3, 3) commanded tip now.
        dt: s.
        feed_forward: whether the desired velocity is added.
        together: whether linear and angular commands share a level.
        parameters: (1,) ``robot.parameters.PARAMETERS``.
        out: (6,) filled: linear m/s, angular rad/s, base frame.
    """
    p = parameters[0]
    error = np.empty(3)
    turn = np.empty(3)
    if feed_forward:
        for i in range(3):
            error[i] = previous_position[i] - tip_position[i]
            out[i] = (desired_position[i] - previous_position[i]) / dt
        rotation_error(desired_rotation, previous_rotation, turn)
        for i in range(3):
            out[3 + i] = turn[i] / dt
        angle = rotation_error(previous_rotation, tip_rotation, turn)
        distance = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        linear, angular = correction_gains(distance, angle, together, parameters)
        speed = linear * distance
        turning = angular * angle
    else:
        for i in range(3):
            error[i] = desired_position[i] - tip_position[i]
            out[i] = 0.0
            out[3 + i] = 0.0
        angle = rotation_error(desired_rotation, tip_rotation, turn)
        distance = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        speed = resolved_speed(
            distance, p.speed_max, p.speed_min, p.position_threshold, p.position_ramp
        )
        turning = resolved_speed(
            angle,
            p.angular_speed_max,
            p.angular_speed_min,
            p.orientation_threshold,
            p.orientation_ramp,
        )
    for i in range(3):
        if distance > 0.0:
            out[i] += speed * error[i] / distance
        if angle > 0.0:
            out[3 + i] += turning * turn[i] / angle
