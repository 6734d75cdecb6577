"""Servo commands that make up for the tendons' stretch and friction, as calibrated.

The controller plans bends; what the servos are told is the command that the calibration says will
give that bend (see :mod:`robot.calibration`). Friction holds against the motion, and turns around
over a short way in which the tendons stick (Prandtl's elastic-plastic element, one a tendon); so
does what is added for it, and a resting robot keeps what it had.
"""

from __future__ import annotations

import numpy as np

from robot.compiled import compiled
from robot.records import Compensation, RecordFields

_GAIN, _FULL = int(Compensation.GAIN), int(Compensation.FULL)
SHARE_RATE = 1.0
"""How fast a change of the setting comes into force while the robot moves, 1/s."""


@compiled
def friction_after(f: float, slid: float, stick: float) -> float:
    """Share of full friction on a tendon after it has ``slid``: elastic until it gives way.

    Args:
        f: share before, -1 to 1.
        slid: motion in the disks over the pitch radius, rad.
        stick: motion that takes friction from none to full, rad.
    """
    return min(max(f + slid / stick, -1.0), 1.0)


@compiled
def tendon_motion(
    u_before: float, v_before: float, u: float, v: float, chord: float, out: np.ndarray
) -> None:
    """How far each tendon slid through the disks, over the pitch radius (rad), positive is longer.

    To the change by (u, v) comes what all four share: between disks they run straight, and
    between n disks that are tilted against each other by phi / n the straight way is shorter, in
    all by L phi^2 / (8 n^2).

    Args:
        u_before: bend before, rad.
        v_before: likewise.
        u: bend after, rad.
        v: likewise.
        chord: L / (8 n^2 r): shortening over pitch radius at 1 rad of bend.
        out: (4,) filled.
    """
    shared = chord * ((u_before**2 + v_before**2) - (u**2 + v**2))
    out[0] = u_before - u + shared
    out[1] = v - v_before + shared
    out[2] = u - u_before + shared
    out[3] = v_before - v + shared


@compiled
def follow_friction(
    s: RecordFields, u_before: float, v_before: float, parameters: np.ndarray
) -> None:
    """Carry the friction of the four tendons in the state ``s`` over the bend's last motion."""
    p = parameters[0]
    slid = np.empty(4)
    tendon_motion(u_before, v_before, s.x[7], s.x[8], p.chord, slid)
    for i in range(4):
        s.friction[i] = friction_after(s.friction[i], slid[i], p.stick[i % 2])


@compiled
def held_back(friction: np.ndarray, out: np.ndarray) -> None:
    """How much the friction (4,) of the tendons holds u and v back (2,), shares of full."""
    out[0] = 0.5 * (friction[2] - friction[0])
    out[1] = 0.5 * (friction[1] - friction[3])


@compiled
def follow_setting(s: RecordFields, compensation: int, step: float) -> None:
    """Move the shares of gain and friction in ``s`` toward the setting by at most ``step``."""
    goals = (
        1.0 if compensation >= _GAIN else 0.0,
        1.0 if compensation == _FULL else 0.0,
    )
    for k in range(2):
        s.compensation[k] += min(max(goals[k] - s.compensation[k], -step), step)


@compiled
def commanded_bend(s: RecordFields, parameters: np.ndarray, out: np.ndarray) -> None:
    """The (u, v) (2,) that the servos are told so that the segment bends to the state's (u, v)."""
    p = parameters[0]
    shares = np.empty(2)
    held_back(s.friction, shares)
    for k in range(2):
        gain = 1.0 + s.compensation[0] * (p.gain[k] - 1.0)
        held = s.compensation[1] * p.friction[k] * shares[k]
        out[k] = (s.x[7 + k] - s.compensation[0] * p.offset[k] + held) / gain


@compiled
def expected_bend(s: RecordFields, u: float, v: float, parameters: np.ndarray) -> None:
    """Set the state's (u, v) to the bend that the servos' (u, v) should give."""
    p = parameters[0]
    told = (u, v)
    shares = np.empty(2)
    held_back(s.friction, shares)
    for k in range(2):
        gain = 1.0 + s.compensation[0] * (p.gain[k] - 1.0)
        held = s.compensation[1] * p.friction[k] * shares[k]
        s.x[7 + k] = gain * told[k] + s.compensation[0] * p.offset[k] - held
