"""Servos, tendons and joint drives of the simulated robot: what is done before every step.

Pure functions on arrays; the engine takes the results as rest angles and rest lengths of springs,
which it integrates implicitly.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled

ACTUATION = np.dtype(
    [
        ("step_s", "f8"),
        ("joint_lag_s", "f8", 7),
        ("joint_lead_s", "f8"),
        ("servo_lag_s", "f8"),
        ("servo_speed", "f8"),
        ("servo_tick", "f8"),
        ("pulley_radius", "f8"),
        ("tendon_length", "f8", 4),
        ("tendon_stiffness", "f8", 4),
        ("pretension", "f8", 4),
        ("friction", "f8", 4),
        ("stick", "f8", 4),
    ]
)
"""Constants in SI units. ``joint_lead_s``: damping over stiffness of the arm's joints;
``servo_tick``: rad, 0 for none; ``tendon_length``: of the straight segment; ``stick``: stiffness of
a tendon that sticks in the disks, N/m."""

DRIVES = np.dtype(
    [
        ("q_wanted", "f8", 7),
        ("q_reference", "f8", 7),
        ("servo_wanted", "f8", 4),
        ("servo_reference", "f8", 4),
        ("servo", "f8", 4),
        ("anchor", "f8", 4),
        ("tension", "f8", 4),
        ("rest", "f8", 4),
        ("torn", "i1", 4),
    ]
)
"""State of the drives: what was commanded, where the references are, the servos' angles, where each
tendon's stick spring is anchored, the tension at the servos in N, and which tendons are torn."""


@compiled
def drive_joints(drives: np.ndarray, constants: np.ndarray, q_rest: np.ndarray) -> None:
    """Each joint's reference follows its command with the joint's own lag, as its servo does.

    The springs' damping acts against all motion; the rest angle leads by as much as that costs.

    Args:
        drives: (1,) changed.
        constants: (1,).
        q_rest: (7,) filled with the rest angles of the joints' springs, rad.
    """
    d, c = drives[0], constants[0]
    for k in range(7):
        rate = (d.q_wanted[k] - d.q_reference[k]) / c.joint_lag_s[k]
        moved = (d.q_wanted[k] - d.q_reference[k]) * (1.0 - math.exp(-c.step_s / c.joint_lag_s[k]))
        d.q_reference[k] += moved
        q_rest[k] = d.q_reference[k] + c.joint_lead_s * rate


@compiled
def turn_servos(drives: np.ndarray, constants: np.ndarray) -> None:
    """Each servo follows its command with a lag, no faster than it can, and stops at whole ticks.

    Args:
        drives: (1,) changed.
        constants: (1,).
    """
    d, c = drives[0], constants[0]
    share = 1.0 - math.exp(-c.step_s / c.servo_lag_s)
    fastest = c.servo_speed * c.step_s
    for i in range(4):
        moved = share * (d.servo_wanted[i] - d.servo_reference[i])
        d.servo_reference[i] += min(max(moved, -fastest), fastest)
        d.servo[i] = d.servo_reference[i]
        if c.servo_tick > 0.0:
            d.servo[i] = c.servo_tick * np.rint(d.servo_reference[i] / c.servo_tick)


@compiled
def hold_tendons(
    drives: np.ndarray,
    constants: np.ndarray,
    length: np.ndarray,
    stiffness: np.ndarray,
    rest_length: np.ndarray,
) -> None:
    """Stretch and friction of the tendons become one pull-only spring each, as the servos stand.

    A tendon that sticks in the disks is held by a second spring to where it last slid; at the
    Coulomb limit its anchor slides along. So friction holds without creeping.

    Args:
        drives: (1,) changed.
        constants: (1,).
        length: (4,) of the routed tendons, m.
        stiffness: (4,) filled, N/m.
        rest_length: (4,) filled, m.
    """
    d, c = drives[0], constants[0]
    for i in range(4):
        slack = c.pretension[i] / c.tendon_stiffness[i]
        rest = c.tendon_length[i] + c.pulley_radius * d.servo[i] - slack
        d.rest[i] = rest
        if d.torn[i] != 0:
            d.tension[i], d.anchor[i] = 0.0, length[i]
            stiffness[i], rest_length[i] = 0.0, rest
            continue
        stretch = length[i] - rest
        d.tension[i] = max(0.0, c.tendon_stiffness[i] * stretch)
        # No more friction than tension presses the tendon onto the disks.
        limit = min(c.friction[i], d.tension[i])
        reach = limit / c.stick[i]
        off = length[i] - d.anchor[i]
        if abs(off) > reach:
            d.anchor[i] = length[i] - math.copysign(reach, off)
            stiffness[i] = c.tendon_stiffness[i]
            rest_length[i] = rest - math.copysign(limit, off) / c.tendon_stiffness[i]
        else:
            stiffness[i] = c.tendon_stiffness[i] + c.stick[i]
            rest_length[i] = (c.tendon_stiffness[i] * rest + c.stick[i] * d.anchor[i]) / stiffness[
                i
            ]
