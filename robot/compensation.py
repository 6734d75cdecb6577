"""Servo commands that make up for the tendons' stretch and friction, as calibrated.

The controller plans bends; what the servos are told is the command that the calibration says will
give that bend (see :mod:`robot.calibration`). Friction holds with the sign of the motion, and turns
around over a short way (Dahl); so does what is added for it, and a resting robot keeps what it had.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.records import Compensation, RecordFields

_GAIN, _FULL = int(Compensation.GAIN), int(Compensation.FULL)
SHARE_RATE = 1.0
"""How fast a change of the setting comes into force while the robot moves, 1/s."""


@compiled
def friction_after(f: float, moved: float, stick: float) -> float:
    """Share of full friction after the bend has ``moved`` (rad); Dahl's model, solved exactly.

    Args:
        f: share before, -1 to 1.
        moved: motion of the bend, rad.
        stick: way over which friction turns around, rad.
    """
    goal = 1.0 if moved > 0.0 else -1.0
    return goal + (f - goal) * math.exp(-abs(moved) / stick)


@compiled
def follow_friction(
    s: RecordFields, u_before: float, v_before: float, parameters: np.ndarray
) -> None:
    """Carry the friction in the state ``s`` over the bend's last motion."""
    p = parameters[0]
    before = (u_before, v_before)
    for k in range(2):
        s.friction[k] = friction_after(s.friction[k], s.x[7 + k] - before[k], p.stick[k])


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
    for k in range(2):
        gain = 1.0 + s.compensation[0] * (p.gain[k] - 1.0)
        held = s.compensation[1] * p.friction[k] * s.friction[k]
        out[k] = (s.x[7 + k] - s.compensation[0] * p.offset[k] + held) / gain


@compiled
def expected_bend(s: RecordFields, u: float, v: float, parameters: np.ndarray) -> None:
    """Set the state's (u, v) to the bend that the servos' (u, v) should give."""
    p = parameters[0]
    told = (u, v)
    for k in range(2):
        gain = 1.0 + s.compensation[0] * (p.gain[k] - 1.0)
        held = s.compensation[1] * p.friction[k] * s.friction[k]
        s.x[7 + k] = gain * told[k] + s.compensation[0] * p.offset[k] - held
