"""Tendons, pulleys, servos.

Tendon i stands at +(i-1) 90 degrees about the segment's z axis, counted right-handed from its x
axis. Its length changes by r [-u, v, u, -v]_i: linear in (u, v), so servo limits are a box there.
Source: paper 1, eqs. (75)-(87); l_i = Delta_i (theta - theta_0) with Delta_i = r cos(delta_i).
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled


@compiled
def tendon_lengths(u: float, v: float, pitch_radius: float, out: np.ndarray) -> None:
    """Length changes (4,) in m of the four tendons; negative is pulled."""
    out[0] = -pitch_radius * u
    out[1] = pitch_radius * v
    out[2] = pitch_radius * u
    out[3] = -pitch_radius * v


@compiled
def servo_angles(
    u: float, v: float, pitch_radius: float, pulley_radius: float, out: np.ndarray
) -> None:
    """Servo angles (4,) in rad that give (u, v): tendon length change over pulley radius."""
    tendon_lengths(u, v, pitch_radius, out)
    for index in range(4):
        out[index] /= pulley_radius


@compiled
def bend_from_servos(
    servo: np.ndarray, pitch_radius: float, pulley_radius: float
) -> tuple[float, float]:
    """(u, v) in rad of four servo angles (rad), least squares over the redundant pairs."""
    ratio = 0.5 * pulley_radius / pitch_radius
    return ratio * (servo[2] - servo[0]), ratio * (servo[1] - servo[3])


def servo_jacobian_polar(
    theta: float, delta: float, pitch_radius: float, pulley_radius: float
) -> np.ndarray:
    """Servo rates per (theta, delta) rate, (4, 2); paper eqs. (83), (86).

    Eq. (8)'s second column needs the factor (theta - pi/2), as (83) has it.
    """
    columns = np.empty((4, 2))
    for index in range(4):
        angle = delta + index * 0.5 * math.pi
        columns[index, 0] = math.cos(angle)
        columns[index, 1] = -(theta - 0.5 * math.pi) * math.sin(angle)
    return pitch_radius / pulley_radius * columns


def ticks_from_angles(servo: np.ndarray, ticks_per_turn: int) -> np.ndarray:
    """Nearest servo positions, integer ticks from the straight segment."""
    return np.rint(servo * (ticks_per_turn / (2.0 * math.pi))).astype(np.int64)


def angles_from_ticks(ticks: np.ndarray, ticks_per_turn: int) -> np.ndarray:
    """Servo angles in rad of integer ticks from the straight segment."""
    return np.asarray(ticks, dtype=float) * (2.0 * math.pi / ticks_per_turn)
