"""What the instrument watches in every tick beside requests and leader: where it was measured."""

from __future__ import annotations

import math

import numpy as np

from robot.compensation import expected_bend, follow_setting
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
from robot.tendons import bend_from_servos
from robot.tension.cells import cells_read, follow_cells
from robot.tension.records import TendonMode
from robot.tension.tendon_command import FROM_MEASURED, holds_tensions

_ENABLED, _PAUSED = int(Safety.ENABLED), int(Safety.PAUSED)
_ENABLE = int(Event.ENABLE)
_LOST, _TRACKING = int(Event.MEASUREMENT_LOST), int(Event.TRACKING_ERROR)
_CONTACT, _CLEARANCE, _TROCAR = (
    int(Event.CONTACT_FORCE),
    int(Event.CLEARANCE),
    int(Event.TROCAR_LEFT),
)
_UNKNOWN, _RUNS = int(Event.TENSION_UNKNOWN), int(Event.TENDON_RUNS)
_TENSION = int(TendonMode.TENSION)
_CONTACT_MARGIN = 1.25
_CLEARANCE_MARGIN = 0.001


@compiled
def tracking_distance(x: np.ndarray, measured_q: np.ndarray) -> float:
    """Largest distance in rad between commanded and measured joint angles."""
    largest = 0.0
    for i in range(7):
        largest = max(largest, abs(x[i] - measured_q[i]))
    return largest


@compiled
def servo_tracking_distance(s: RecordFields, measured_servo: np.ndarray) -> float:
    """Largest distance in rad between commanded and measured angles of servos that hold one."""
    largest = 0.0
    for i in range(4):
        if s.tendon_mode[i] != _TENSION:
            largest = max(largest, abs(s.tendon_servo[i] - measured_servo[i]))
    return largest


@compiled
def _watch_tensions(outcome: np.ndarray, i: RecordFields, p: RecordFields) -> None:
    """Pause where tensions are to be held and a cell is blind; fault where a tendon ran away."""
    s = outcome[0].state
    if holds_tensions(i) and not cells_read(s, i, p):
        apply_event(outcome, _UNKNOWN)
    for k in range(4):
        off = p.pulley_radius * abs(i.measured_servo[k] - s.tendon_servo[k])
        if s.tendon_mode[k] == _TENSION and not off <= p.tendon_travel:
            apply_event(outcome, _RUNS)


@compiled
def _measured(tick_input: RecordFields) -> bool:
    """Whether the measurement is valid, recent, and made of numbers."""
    total = 0.0
    for k in range(7):
        total += abs(tick_input.measured_q[k])
    for k in range(4):
        total += abs(tick_input.measured_servo[k])
    return bool(is_recent(tick_input) and math.isfinite(total))


@compiled
def _watch_contact(outcome: np.ndarray, i: RecordFields, p: RecordFields) -> None:
    """Pause where the contact force exceeds what is allowed.

    Whoever enables in contact may move on with a little more force than there is, or nobody could
    ever move away; once the force is below the limit, the limit counts again.
    """
    s = outcome[0].state
    force = i.measured_contact
    if i.request == _ENABLE:
        s.contact_allowance = max(p.contact_force, _CONTACT_MARGIN * force)
    if force <= p.contact_force:
        s.contact_allowance = p.contact_force
    if not force <= s.contact_allowance:
        apply_event(outcome, _CONTACT)


@compiled
def _watch_clearance(outcome: np.ndarray, i: RecordFields, p: RecordFields) -> None:
    """Pause where arm, shaft and wall come too near; fault where the shaft left the trocar.

    Whoever enables too near may move on as long as it does not come nearer still.
    """
    s = outcome[0].state
    if i.request == _ENABLE:
        s.clearance_allowance = min(p.clearance, s.clearance - _CLEARANCE_MARGIN)
    if s.clearance >= p.clearance:
        s.clearance_allowance = p.clearance
    if not s.clearance >= s.clearance_allowance:
        apply_event(outcome, _CLEARANCE)
    if not s.trocar_distance <= p.trocar_distance:
        apply_event(outcome, _TROCAR)


@compiled
def _take_measured(outcome: np.ndarray, i: RecordFields, parameters: np.ndarray) -> None:
    """Take the measured joints and servos as the commanded ones."""
    s = outcome[0].state
    p = parameters[0]
    for k in range(7):
        s.x[k] = i.measured_q[k]
    u, v = bend_from_servos(i.measured_servo, p.pitch_radius, p.pulley_radius)
    follow_setting(s, i.settings.compensation, 1.0)
    expected_bend(s, u, v, parameters)
    if holds_tensions(i) or s.tendon_map != 0:
        s.tendon_map = FROM_MEASURED
        for k in range(4):
            s.tendon_servo[k] = i.measured_servo[k]


@compiled
def decide(outcome: np.ndarray, tick_input: np.ndarray, parameters: np.ndarray) -> bool:
    """Apply this tick's request and what the measurement tells to the state in ``outcome``.

    Args:
        outcome: (1,) record whose ``state`` is changed.
        tick_input: (1,) input record.
        parameters: (1,) parameters.

    Returns:
        Whether the robot has just been enabled and takes the measured joints as its own; such a
        tick does not move.
    """
    s = outcome[0].state
    i = tick_input[0]
    p = parameters[0]
    takes_measured = take_request(outcome, i)
    follow_cells(s, i)
    if plant_speaks(outcome, i):
        return False
    if not _measured(i):
        apply_event(outcome, _LOST)
        return False
    watch_lateness(outcome, i, p.late_tick)
    _watch_contact(outcome, i, p)
    _watch_clearance(outcome, i, p)
    _watch_tensions(outcome, i, p)
    if takes_measured and s.safety in (_ENABLED, _PAUSED):
        _take_measured(outcome, i, parameters)
        return True
    follows = tracking_distance(s.x, i.measured_q) <= p.tracking_error
    if not (follows and servo_tracking_distance(s, i.measured_servo) <= p.servo_tracking_error):
        apply_event(outcome, _TRACKING)
    watch_leader(outcome, i)
    return False
