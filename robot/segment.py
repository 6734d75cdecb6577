"""The continuum segment, in the coordinates u = phi cos(delta), v = phi sin(delta).

phi is the bend (pi/2 - theta in the paper's words), delta the bending direction. The tip leans to
(u, -v) / phi. (theta, delta) are polar coordinates: at the straight segment delta is undefined and
its column of the Jacobian vanishes. (u, v), the literature's Clarke coordinates, have no such
point; they are the state, (theta, delta) is what people see.

Source: paper 1, section 2.1, eqs. (1)-(17). Corrections: (5), (6) read Delta_i = r cos(delta_i)
with delta_i = delta + (i-1) beta; (15) is garbled and replaced by the derivative of the arc below;
(17) is right.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled

STRAIGHT = 1e-3
"""Below this bend (rad) the arc's coefficients come from their Taylor series; at it, the neglected
terms are below 1e-16."""


@compiled
def _coefficients(phi: float) -> tuple[float, float, float, float]:
    """(1-cos)/phi^2, sin/phi and their derivatives divided by phi."""
    square = phi * phi
    if phi < STRAIGHT:
        versine = 0.5 - square / 24.0 + square * square / 720.0
        sinc = 1.0 - square / 6.0 + square * square / 120.0
        versine_slope = -1.0 / 12.0 + square / 180.0
        sinc_slope = -1.0 / 3.0 + square / 30.0
    else:
        sine = math.sin(phi)
        cosine = math.cos(phi)
        half = math.sin(0.5 * phi)
        versine = 2.0 * half * half / square
        sinc = sine / phi
        versine_slope = (sinc - 2.0 * versine) / square
        sinc_slope = (cosine - sinc) / square
    return versine, sinc, versine_slope, sinc_slope


@compiled
def tip_position(u: float, v: float, length: float, out: np.ndarray) -> None:
    """Tip of an arc of ``length`` (m) in the segment's base frame, written to ``out`` (3,), m."""
    versine, sinc, _, _ = _coefficients(math.hypot(u, v))
    out[0] = length * versine * u
    out[1] = -length * versine * v
    out[2] = length * sinc


@compiled
def tip_rotation(u: float, v: float, out: np.ndarray) -> None:
    """Tip frame in the segment's base frame: Rz(-delta) Ry(phi) Rz(delta) = exp(v, u, 0).

    Args:
        u: first coordinate, rad.
        v: second coordinate, rad.
        out: (3, 3) filled with the rotation matrix.
    """
    versine, sinc, _, _ = _coefficients(math.hypot(u, v))
    out[0, 0] = 1.0 - versine * u * u
    out[0, 1] = versine * u * v
    out[0, 2] = sinc * u
    out[1, 0] = versine * u * v
    out[1, 1] = 1.0 - versine * v * v
    out[1, 2] = -sinc * v
    out[2, 0] = -sinc * u
    out[2, 1] = sinc * v
    out[2, 2] = 1.0 - versine * (u * u + v * v)


@compiled
def jacobian(u: float, v: float, length: float, out: np.ndarray) -> None:
    """Tip twist per (u, v) rate, in the segment's base frame.

    Args:
        u: first coordinate, rad.
        v: second coordinate, rad.
        length: segment length, m.
        out: (6, 2) filled; rows linear (m/rad) then angular (rad/rad), columns u, v.
    """
    phi = math.hypot(u, v)
    versine, _, versine_slope, sinc_slope = _coefficients(phi)
    out[0, 0] = length * (versine + versine_slope * u * u)
    out[0, 1] = length * versine_slope * u * v
    out[1, 0] = -length * versine_slope * u * v
    out[1, 1] = -length * (versine + versine_slope * v * v)
    out[2, 0] = length * sinc_slope * u
    out[2, 1] = length * sinc_slope * v
    # Left Jacobian of SO(3) at the rotation vector w = (v, u, 0):
    # J = I + versine [w]x + cubic [w]x^2, applied to the rates (0, 1, 0) and (1, 0, 0).
    cubic = -_left_jacobian_coefficient(phi)
    out[3, 0] = cubic * u * v
    out[4, 0] = 1.0 - cubic * v * v
    out[5, 0] = versine * v
    out[3, 1] = 1.0 - cubic * u * u
    out[4, 1] = cubic * u * v
    out[5, 1] = -versine * u


@compiled
def _left_jacobian_coefficient(phi: float) -> float:
    """(sin(phi)/phi - 1) / phi^2: the coefficient of [w]x^2 in SO(3)'s left Jacobian, negated."""
    square = phi * phi
    if phi < STRAIGHT:
        return -1.0 / 6.0 + square / 120.0
    return (math.sin(phi) / phi - 1.0) / square


@compiled
def jacobian_polar(theta: float, delta: float, length: float, out: np.ndarray) -> None:
    """Tip twist per (theta, delta) rate, in the segment's base frame; paper eqs. (11)-(17).

    At the straight segment (theta = pi/2) the second column is zero: delta does nothing there.

    Args:
        theta: pi/2 minus the bend, rad.
        delta: bending direction, rad.
        length: segment length, m.
        out: (6, 2) filled; rows linear then angular, columns theta, delta.
    """
    phi = 0.5 * math.pi - theta
    u, v = phi * math.cos(delta), phi * math.sin(delta)
    rectangular = np.empty((6, 2))
    jacobian(u, v, length, rectangular)
    for row in range(6):
        du, dv = rectangular[row, 0], rectangular[row, 1]
        out[row, 0] = -(math.cos(delta) * du + math.sin(delta) * dv)
        out[row, 1] = -v * du + u * dv


@compiled
def polar(u: float, v: float) -> tuple[float, float]:
    """(theta, delta) in rad; delta is 0 at the straight segment."""
    phi = math.hypot(u, v)
    delta = math.atan2(v, u) if phi > 0.0 else 0.0
    return 0.5 * math.pi - phi, delta


@compiled
def rectangular(theta: float, delta: float) -> tuple[float, float]:
    """(u, v) in rad of (theta, delta)."""
    phi = 0.5 * math.pi - theta
    return phi * math.cos(delta), phi * math.sin(delta)


def shape_frames(
    u: float, v: float, length: float, fractions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Frames along the backbone, for drawing.

    Args:
        u: first coordinate, rad.
        v: second coordinate, rad.
        length: segment length, m.
        fractions: (n,) places along the backbone, 0 at the base and 1 at the tip.

    Returns:
        Positions (n, 3) in m and rotation matrices (n, 3, 3), in the segment's base frame.
    """
    positions = np.empty((len(fractions), 3))
    rotations = np.empty((len(fractions), 3, 3))
    for index, fraction in enumerate(fractions):
        tip_position(u * fraction, v * fraction, length * fraction, positions[index])
        tip_rotation(u * fraction, v * fraction, rotations[index])
    return positions, rotations
