"""What the concentric-tube arms watch in every tick beside requests and leader."""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.records import RecordFields, Safety
from robot.safety import (
    Event,
    apply_event,
    is_recent,
    plant_speaks,
    take_request,
    watch_lateness,
    watch_leader,
)

_ENABLED, _ENABLE = int(Safety.ENABLED), int(Event.ENABLE)
_LOST, _TRACKING = int(Event.MEASUREMENT_LOST), int(Event.TRACKING_ERROR)
_RELATIVE = int(Event.RELATIVE_ERROR)
_RELATIVE_MARGIN = 1.25


@compiled
def _measured(i: RecordFields) -> bool:
    """Whether the measurement is valid, recent, and made of numbers."""
    total = 0.0
    for value in i.measured_q:
        total += abs(value)
    return bool(is_recent(i) and math.isfinite(total))


@compiled
def follows(
    q: np.ndarray, measured_q: np.ndarray, translation_max: float, rotation_max: float
) -> bool:
    """Whether every tube was measured near where it is commanded.

    Args:
        q: (4n,) commanded axes of both arms, m and rad.
        measured_q: (4n,) measured ones.
        translation_max: how far a translation may be off, m.
        rotation_max: how far a rotation may be off, rad.
    """
    tubes = q.size // 4
    for axis in range(q.size):
        is_rotation = (axis // tubes) % 2 == 1
        allowed = rotation_max if is_rotation else translation_max
        if not abs(q[axis] - measured_q[axis]) <= allowed:
            return False
    return True


@compiled
def _watch_relative(outcome: np.ndarray, i: RecordFields, p: RecordFields) -> None:
    """Pause where B has lost its place beside A.

    Whoever enables there may move on with a little more than there is, or nobody could ever move
    away; once it is below the limit, the limit counts again.
    """
    s = outcome[0].state
    square = 0.0
    for k in range(3):
        off = s.relative_position[k] - (s.position_b[k] - s.tip_position[k])
        square += off * off
    distance = math.sqrt(square)
    if i.request == _ENABLE:
        s.relative_allowance = max(p.relative_error, _RELATIVE_MARGIN * distance)
    if distance <= p.relative_error:
        s.relative_allowance = p.relative_error
    if not distance <= s.relative_allowance:
        apply_event(outcome, _RELATIVE)


@compiled
def decide(outcome: np.ndarray, tick_input: np.ndarray, parameters: np.ndarray) -> bool:
    """Apply this tick's request and what the measurement tells to the state in ``outcome``.

    Args:
        outcome: (1,) record whose ``state`` is changed.
        tick_input: (1,) input record.
        parameters: (1,) ``robot.concentric.parameters.PARAMETERS``.

    Returns:
        Whether the robot has just been enabled and takes the measured tubes as its own; such a tick
        does not move.
    """
    s = outcome[0].state
    i = tick_input[0]
    p = parameters[0]
    takes_measured = take_request(outcome, i)
    if plant_speaks(outcome, i):
        return False
    if not _measured(i):
        apply_event(outcome, _LOST)
        return False
    watch_lateness(outcome, i, p.late_tick)
    if takes_measured and s.safety == _ENABLED:
        s.relative_allowance = p.relative_error
        return True
    _watch_relative(outcome, i, p)
    if not follows(s.q, i.measured_q, p.tracking_error, p.tracking_angle):
        apply_event(outcome, _TRACKING)
    watch_leader(outcome, i)
    return False
