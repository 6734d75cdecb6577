"""Limits on the rates of x, so that no tick leaves the allowed configurations.

All are linear in the rates: a box, and one row for the bend. They stand above every level.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.tendons import bend_from_servos

JOINT_POSITION_BIT = 0
JOINT_SPEED_BIT = 7
BEND_BIT = 14
SERVO_RANGE_BIT = 15
SERVO_SPEED_BIT = 16
LAMBDA_LOW_BIT = 17
LAMBDA_HIGH_BIT = 18

BEND_MARGIN = 5e-5
"""Least distance kept from the bend limit, rad; see :func:`bend_margin`."""
LAMBDA_MARGIN = 1e-4
"""Kept from both ends of lambda: the true shaft and the commanded lambda differ by up to this after
a fast tick."""
LAMBDA_SPEED = 2.0
"""Largest rate of lambda, 1/s: with a 230 mm shaft, an insertion of 460 mm/s."""
_TOUCH = 1e-9
_STAND_ASIDE, _BENT_ASIDE = math.radians(2.0), math.radians(5.0)
"""How far outside of joint and bend limits a robot may stand and still be enabled, rad."""


@compiled
def _interval(
    value: float, lower: float, upper: float, speed: float, gain: float, dt: float
) -> tuple[float, float]:
    """Rates that keep ``value`` inside, slowing down before the end; outside, they lead back."""
    up = min(speed, gain * (upper - value) / dt)
    down = max(-speed, gain * (lower - value) / dt)
    return max(min(down, speed), -speed), min(max(up, -speed), speed)


@compiled
def bend_margin(parameters: np.ndarray, dt: float) -> float:
    """Distance kept from the bend limit, rad.

    A tick along the limit's circle goes straight and so leaves the circle: at the servos' fastest,
    along the diagonal of their box, by this much. The next tick takes it back.
    """
    p = parameters[0]
    step = math.sqrt(2.0) * p.pulley_radius / p.pitch_radius * p.servo_speed * dt
    leaving = p.bend_max - math.sqrt(max(p.bend_max**2 - step**2, 0.25 * p.bend_max**2))
    return float(max(BEND_MARGIN, leaving))


@compiled
def rate_limits(
    x: np.ndarray,
    dt: float,
    parameters: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    bend_row: np.ndarray,
) -> float:
    """Bounds on the rates of x.

    Args:
        x: (10,) commanded configuration.
        dt: s.
        parameters: (1,) parameters.
        lower: (>= 10,) filled with the lower bounds, rad/s and 1/s.
        upper: (>= 10,) likewise the upper bounds.
        bend_row: (10,) filled so that ``bend_row @ x_dot <= bound``.

    Returns:
        The bound of the bend row, rad/s.
    """
    p = parameters[0]
    gain = p.approach_gain
    for i in range(7):
        lower[i], upper[i] = _interval(
            x[i], p.joint_lower[i], p.joint_upper[i], p.joint_speed[i], gain, dt
        )
    ratio = p.pulley_radius / p.pitch_radius
    for i in range(7, 9):
        lower[i], upper[i] = _interval(
            x[i], -ratio * p.servo_max, ratio * p.servo_max, ratio * p.servo_speed, gain, dt
        )
    lower[9], upper[9] = _interval(
        x[9], p.lambda_min + LAMBDA_MARGIN, p.lambda_max - LAMBDA_MARGIN, LAMBDA_SPEED, gain, dt
    )
    phi = math.hypot(x[7], x[8])
    for i in range(10):
        bend_row[i] = 0.0
    bend_row[7] = x[7] / phi if phi > 1e-9 else 1.0
    bend_row[8] = x[8] / phi if phi > 1e-9 else 0.0
    room = p.bend_max - bend_margin(parameters, dt) - phi
    if room < 0.0:
        # All of it is taken back, but no faster than the servos can.
        return float(max(room / dt, -ratio * p.servo_speed))
    return float(gain * room / dt)


@compiled
def stands_inside(q: np.ndarray, servo: np.ndarray, parameters: np.ndarray) -> bool:
    """Whether measured joints (7,) and servos (4,), rad, stand where a motion may begin.

    A little outside is taken back by :func:`rate_limits`; further out, somebody else has to.
    """
    p = parameters[0]
    for k in range(7):
        if q[k] < p.joint_lower[k] - _STAND_ASIDE or q[k] > p.joint_upper[k] + _STAND_ASIDE:
            return False
    u, v = bend_from_servos(servo, p.pitch_radius, p.pulley_radius)
    return bool(math.hypot(u, v) <= p.bend_max + _BENT_ASIDE)


@compiled
def lock_arm(lower: np.ndarray, upper: np.ndarray) -> None:
    """Let the joints, and with them lambda, stand still; the segment alone moves."""
    lower[:7], upper[:7] = 0.0, 0.0
    lower[9], upper[9] = 0.0, 0.0


@compiled
def lock_segment(lower: np.ndarray, upper: np.ndarray) -> None:
    """Let the segment keep its bend; the arm alone moves."""
    lower[7:9], upper[7:9] = 0.0, 0.0


@compiled
def active_limits(
    x: np.ndarray,
    x_dot: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    bend_row: np.ndarray,
    bend_bound: float,
    parameters: np.ndarray,
) -> int:
    """Bits of the limits that hold the motion back this tick (see the ``*_BIT`` constants)."""
    p = parameters[0]
    bits = 0
    ratio = p.pulley_radius / p.pitch_radius
    for i in range(10):
        touched = x_dot[i] >= upper[i] - _TOUCH or x_dot[i] <= lower[i] + _TOUCH
        locked = lower[i] == 0.0 and upper[i] == 0.0
        if locked or not touched:
            continue
        bound = upper[i] if x_dot[i] >= upper[i] - _TOUCH else -lower[i]
        if i < 7:
            at_speed = bound >= p.joint_speed[i] - _TOUCH
            bits |= 1 << ((JOINT_SPEED_BIT if at_speed else JOINT_POSITION_BIT) + i)
        elif i < 9:
            at_speed = bound >= ratio * p.servo_speed - _TOUCH
            bits |= 1 << (SERVO_SPEED_BIT if at_speed else SERVO_RANGE_BIT)
        else:
            bits |= 1 << (LAMBDA_HIGH_BIT if x_dot[i] >= upper[i] - _TOUCH else LAMBDA_LOW_BIT)
    if bend_row[7] * x_dot[7] + bend_row[8] * x_dot[8] >= bend_bound - _TOUCH:
        bits |= 1 << BEND_BIT
    return bits


@compiled
def violations(x: np.ndarray, parameters: np.ndarray) -> int:
    """How many position limits (joints, bend, servo range, lambda) configuration ``x`` breaks."""
    p = parameters[0]
    count = 0
    for i in range(7):
        if not p.joint_lower[i] - 1e-12 <= x[i] <= p.joint_upper[i] + 1e-12:
            count += 1
    if not math.hypot(x[7], x[8]) <= p.bend_max + 1e-12:
        count += 1
    reach = p.servo_max * p.pulley_radius / p.pitch_radius + 1e-12
    if not (abs(x[7]) <= reach and abs(x[8]) <= reach):
        count += 1
    if not p.lambda_min - 1e-12 <= x[9] <= p.lambda_max + 1e-12:
        count += 1
    return count


@compiled
def speed_violations(x_dot: np.ndarray, parameters: np.ndarray) -> int:
    """How many speed limits (joints, servos) the rates ``x_dot`` (10,) break."""
    p = parameters[0]
    count = 0
    for i in range(7):
        if not abs(x_dot[i]) <= p.joint_speed[i] + 1e-9:
            count += 1
    fastest = p.servo_speed * p.pulley_radius / p.pitch_radius + 1e-9
    for i in range(7, 9):
        if not abs(x_dot[i]) <= fastest:
            count += 1
    return count


@compiled
def share_within(
    x_dot: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    bend_row: np.ndarray,
    bend_bound: float,
) -> float:
    """Largest s in [0, 1] for which ``s * x_dot`` keeps every limit.

    The closed forms know no limits. Scaling the whole motion keeps its direction and so the RCM,
    which clipping single rates would break.
    """
    share = 1.0
    for i in range(10):
        if x_dot[i] > upper[i]:
            share = min(share, max(upper[i], 0.0) / x_dot[i])
        elif x_dot[i] < lower[i]:
            share = min(share, min(lower[i], 0.0) / x_dot[i])
    bend_rate = bend_row[7] * x_dot[7] + bend_row[8] * x_dot[8]
    if bend_rate > bend_bound:
        share = min(share, max(bend_bound, 0.0) / bend_rate)
    return share


def describe(bits: int, x: np.ndarray, parameters: np.ndarray) -> list[str]:
    """The active limits in words, for people.

    Args:
        bits: as :func:`active_limits` returns them.
        x: (10,) configuration at the time.
        parameters: (1,) parameters.
    """
    p = parameters[0]
    words = []
    for i in range(7):
        if bits >> (JOINT_POSITION_BIT + i) & 1:
            middle = 0.5 * (p["joint_lower"][i] + p["joint_upper"][i])
            end = "upper" if x[i] > middle else "lower"
            limit = math.degrees(p[f"joint_{end}"][i])
            words.append(f"joint {i + 1} at its {end} limit ({limit:.1f} deg)")
        if bits >> (JOINT_SPEED_BIT + i) & 1:
            words.append(f"joint {i + 1} at its speed limit")
    if bits >> BEND_BIT & 1:
        words.append(f"bend limit {math.degrees(p['bend_max']):.0f} deg")
    if bits >> SERVO_RANGE_BIT & 1:
        words.append("servo range limit")
    if bits >> SERVO_SPEED_BIT & 1:
        words.append("servo speed limit")
    if bits >> LAMBDA_LOW_BIT & 1:
        words.append("shaft fully inserted (lambda at its lower limit)")
    if bits >> LAMBDA_HIGH_BIT & 1:
        words.append("shaft fully withdrawn to the trocar (lambda at its upper limit)")
    return words
