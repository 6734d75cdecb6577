"""The safety states: one printed table of transitions, applied at the start of every tick.

It fails closed: what the table does not list is refused and changes nothing; leaving FAULT takes an
explicit RESET and leads to DISABLED, never to motion.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from robot.compensation import commanded_bend, expected_bend, follow_setting
from robot.compiled import compiled
from robot.errors import KeyholeError
from robot.records import RecordFields, Request, Safety
from robot.tendons import bend_from_servos, servo_angles


class Event(IntEnum):
    """What can happen to the safety state; the first seven are requests."""

    NOTHING = 0
    ENABLE = 1
    DISABLE = 2
    PAUSE = 3
    RESET = 4
    EMERGENCY_STOP = 5
    OPERATOR_LOST = 6
    LEADER_STALE = 7
    LEADER_JUMP = 8
    LEADER_INVALID = 9
    MEASUREMENT_LOST = 10
    TRACKING_ERROR = 11
    SOLVER_FAILED = 12
    CONTROL_FAILED = 13
    CONTACT_FORCE = 14
    SIMULATION_FAILED = 15
    BUS_LOST = 16
    SERVO_SILENT = 17
    SERVO_FAULT = 18
    ARM_LOST = 19
    ARM_FAULT = 20
    DEVICES_BACK = 21
    CLEARANCE = 22
    TROCAR_LEFT = 23
    CONTROL_LATE = 24


class Transition(NamedTuple):
    """One row of the table: in ``state``, ``event`` leads to ``next``."""

    state: Safety
    event: Event
    next: Safety


_D, _E, _P, _F = Safety.DISABLED, Safety.ENABLED, Safety.PAUSED, Safety.FAULT

TRANSITIONS: tuple[Transition, ...] = (
    Transition(_D, Event.ENABLE, _E),
    Transition(_E, Event.ENABLE, _E),
    Transition(_P, Event.ENABLE, _E),
    Transition(_D, Event.DISABLE, _D),
    Transition(_E, Event.DISABLE, _D),
    Transition(_P, Event.DISABLE, _D),
    Transition(_E, Event.PAUSE, _P),
    Transition(_P, Event.PAUSE, _P),
    Transition(_F, Event.RESET, _D),
    Transition(_D, Event.EMERGENCY_STOP, _F),
    Transition(_E, Event.EMERGENCY_STOP, _F),
    Transition(_P, Event.EMERGENCY_STOP, _F),
    Transition(_F, Event.EMERGENCY_STOP, _F),
    Transition(_E, Event.OPERATOR_LOST, _P),
    Transition(_E, Event.LEADER_STALE, _P),
    Transition(_E, Event.LEADER_JUMP, _P),
    Transition(_E, Event.LEADER_INVALID, _P),
    Transition(_E, Event.MEASUREMENT_LOST, _F),
    Transition(_P, Event.MEASUREMENT_LOST, _F),
    Transition(_E, Event.TRACKING_ERROR, _F),
    Transition(_P, Event.TRACKING_ERROR, _F),
    Transition(_E, Event.SOLVER_FAILED, _F),
    Transition(_D, Event.CONTROL_FAILED, _F),
    Transition(_E, Event.CONTROL_FAILED, _F),
    Transition(_P, Event.CONTROL_FAILED, _F),
    Transition(_F, Event.CONTROL_FAILED, _F),
    Transition(_E, Event.CONTACT_FORCE, _P),
    Transition(_D, Event.SIMULATION_FAILED, _F),
    Transition(_E, Event.SIMULATION_FAILED, _F),
    Transition(_P, Event.SIMULATION_FAILED, _F),
    Transition(_E, Event.BUS_LOST, _P),
    Transition(_P, Event.BUS_LOST, _P),
    Transition(_D, Event.SERVO_SILENT, _F),
    Transition(_E, Event.SERVO_SILENT, _F),
    Transition(_P, Event.SERVO_SILENT, _F),
    Transition(_D, Event.SERVO_FAULT, _F),
    Transition(_E, Event.SERVO_FAULT, _F),
    Transition(_P, Event.SERVO_FAULT, _F),
    Transition(_E, Event.ARM_LOST, _P),
    Transition(_P, Event.ARM_LOST, _P),
    Transition(_D, Event.ARM_FAULT, _F),
    Transition(_E, Event.ARM_FAULT, _F),
    Transition(_P, Event.ARM_FAULT, _F),
    Transition(_P, Event.DEVICES_BACK, _P),
    Transition(_E, Event.CLEARANCE, _P),
    Transition(_E, Event.TROCAR_LEFT, _F),
    Transition(_E, Event.CONTROL_LATE, _P),
)
"""Every transition there is. An event that is not listed for a state leaves the state as it is; if
it was an operator's request, it is refused."""

REASONS: dict[Event, tuple[str, str]] = {
    Event.NOTHING: ("started", "take control, then enable"),
    Event.ENABLE: ("ready", ""),
    Event.DISABLE: ("disabled by the operator", "enable to drive"),
    Event.PAUSE: ("paused by the operator", "enable to go on"),
    Event.RESET: ("reset after a fault", "enable to drive"),
    Event.EMERGENCY_STOP: ("emergency stop", "make sure it is safe, then reset"),
    Event.OPERATOR_LOST: ("the operator's connection was lost", "take control, then enable"),
    Event.LEADER_STALE: ("the leader went silent while driving", "check the device, then enable"),
    Event.LEADER_JUMP: ("the leader jumped; the sample was refused", "enable and engage again"),
    Event.LEADER_INVALID: ("the leader sent an invalid pose", "check the device, then enable"),
    Event.MEASUREMENT_LOST: ("measurements from the robot stopped", "check the robot, then reset"),
    Event.TRACKING_ERROR: (
        "the robot does not follow its commands",
        "look for contact or a blocked axis, then reset",
    ),
    Event.SOLVER_FAILED: ("no motion satisfies the limits", "reset; move away from the limit"),
    Event.CONTROL_FAILED: ("the control loop failed", "read the log, then reset"),
    Event.CONTACT_FORCE: (
        "the instrument presses too hard on something",
        "enable, then move away or withdraw",
    ),
    Event.SIMULATION_FAILED: (
        "the simulation broke down and stands still",
        "restart the console; tell what led to it",
    ),
    Event.BUS_LOST: (
        "the servo bus is gone; the servos hold by themselves",
        "plug it in again: it is found by itself; then enable",
    ),
    Event.SERVO_SILENT: (
        "a servo does not answer",
        "check its cable and its power, then reset",
    ),
    Event.SERVO_FAULT: (
        "a servo reports a fault",
        "read which under Devices, take the cause away, reboot it, then reset",
    ),
    Event.ARM_LOST: (
        "the connection to the arm is gone",
        "check its cable and its controller; then enable",
    ),
    Event.ARM_FAULT: (
        "the arm's controller reports an error",
        "read which under Devices, take the cause away, then reset",
    ),
    Event.DEVICES_BACK: ("all devices are back; nothing moves by itself", "enable to go on"),
    Event.CLEARANCE: (
        "arm, module or shaft come too near to each other or to the body wall",
        "enable, then move away",
    ),
    Event.TROCAR_LEFT: (
        "the shaft was measured beside the trocar",
        "look what pushes the arm, then reset",
    ),
    Event.CONTROL_LATE: (
        "a tick of the control loop came much too late",
        "close what else works on this computer, then enable",
    ),
}
"""For each event that led into the present state: why, and what to do."""

REFUSALS: dict[tuple[Safety, Event], str] = {
    (_F, Event.ENABLE): "the robot is in FAULT: remove the cause, reset, then enable",
    (_F, Event.DISABLE): "the robot is in FAULT and holds already: reset to leave it",
    (_F, Event.PAUSE): "the robot is in FAULT and holds already: reset to leave it",
    (_D, Event.PAUSE): "the robot is disabled; there is no motion to pause",
    (_D, Event.RESET): "there is no fault to reset",
    (_E, Event.RESET): "there is no fault to reset",
    (_P, Event.RESET): "there is no fault to reset",
}
"""Why a request that the table does not list is refused."""


class RequestRefused(KeyholeError):
    """The transition table does not allow what was asked.

    Attributes:
        state: the safety state at the time.
        request: what was asked.
    """

    code = "request_refused"

    def __init__(self, state: Safety, request: Request) -> None:
        super().__init__(REFUSALS.get((state, Event(request)), f"not possible in {state.name}"))
        self.state, self.request = state, request


def successor(state: Safety, event: Event) -> Safety | None:
    """The state that ``event`` leads to, or None where the table has no such row."""
    found = int(_TABLE[event, state])
    return None if found < 0 else Safety(found)


def check_request(state: Safety, request: Request) -> None:
    """Raise :class:`RequestRefused` unless ``request`` is in the table for ``state``."""
    if successor(state, Event(request)) is None:
        raise RequestRefused(state, request)


def printed_table() -> str:
    """The transition table as text, a row a state and event."""
    rows = [f"{'state':<10} {'event':<18} {'next':<10} reason"]
    for row in TRANSITIONS:
        reason = REASONS[row.event][0]
        rows.append(f"{row.state.name:<10} {row.event.name:<18} {row.next.name:<10} {reason}")
    return "\n".join(rows)


def _table() -> np.ndarray:
    table = np.full((len(Event), len(Safety)), -1, dtype=np.int64)
    for row in TRANSITIONS:
        table[row.event, row.state] = row.next
    return table


_TABLE = _table()
_DISABLED, _ENABLED = int(_D), int(_E)
_ENABLE = int(Event.ENABLE)
_STALE, _LOST, _TRACKING = (
    int(Event.LEADER_STALE),
    int(Event.MEASUREMENT_LOST),
    int(Event.TRACKING_ERROR),
)
_CONTACT = int(Event.CONTACT_FORCE)
_BUS_LOST, _ARM_LOST, _BACK = int(Event.BUS_LOST), int(Event.ARM_LOST), int(Event.DEVICES_BACK)
_CLEARANCE, _TROCAR, _LATE = int(Event.CLEARANCE), int(Event.TROCAR_LEFT), int(Event.CONTROL_LATE)
_PAUSED = int(_P)
_CONTACT_MARGIN = 1.25
_CLEARANCE_MARGIN = 0.001
MEASUREMENT_TIMEOUT_S = 0.025


@compiled
def apply_event(state: np.ndarray, event: int) -> bool:
    """Let ``event`` act on the (1,) state record; True if the table has the row."""
    s = state[0].state
    following = _TABLE[event, s.safety]
    if following < 0:
        return False
    s.safety = following
    s.reason = event
    return True


@compiled
def tracking_distance(x: np.ndarray, measured_q: np.ndarray) -> float:
    """Largest distance in rad between commanded and measured joint angles."""
    largest = 0.0
    for i in range(7):
        largest = max(largest, abs(x[i] - measured_q[i]))
    return largest


@compiled
def servo_tracking_distance(
    s: RecordFields, measured_servo: np.ndarray, parameters: np.ndarray
) -> float:
    """Largest distance in rad between commanded and measured servo angles."""
    p = parameters[0]
    told, servo = np.empty(2), np.empty(4)
    commanded_bend(s, parameters, told)
    servo_angles(told[0], told[1], p.pitch_radius, p.pulley_radius, servo)
    largest = 0.0
    for i in range(4):
        largest = max(largest, abs(servo[i] - measured_servo[i]))
    return largest


@compiled
def _measured(tick_input: RecordFields) -> bool:
    """Whether the measurement is valid, recent, and made of numbers."""
    total = 0.0
    for k in range(7):
        total += abs(tick_input.measured_q[k])
    for k in range(4):
        total += abs(tick_input.measured_servo[k])
    recent = tick_input.measured_age_s <= MEASUREMENT_TIMEOUT_S
    return bool(tick_input.measured_valid != 0 and recent and math.isfinite(total))


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
def _request(outcome: np.ndarray, i: RecordFields) -> bool:
    """Apply this tick's request; True if the robot must take the measured joints as its own.

    Nobody enables a robot that is not ready; the server says why.
    """
    s = outcome[0].state
    before, reason = s.safety, s.reason
    if i.request == 0 or (i.request == _ENABLE and i.readiness != 0):
        return False
    apply_event(outcome, i.request)
    if i.request != _ENABLE or s.safety != _ENABLED:
        return False
    # While a device was gone, its axes were stopped by themselves, wherever that was.
    was_gone = reason in (_BUS_LOST, _ARM_LOST, _BACK)
    return bool(before == _DISABLED or (before == _PAUSED and was_gone))


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


@compiled
def _plant_speaks(outcome: np.ndarray, i: RecordFields) -> bool:
    """Apply what the plant tells, or that all its devices are back; True if it tells anything."""
    s = outcome[0].state
    if i.plant_event != 0:
        apply_event(outcome, i.plant_event)
        return True
    if s.reason in (_BUS_LOST, _ARM_LOST) and i.readiness == 0:
        apply_event(outcome, _BACK)
    return False


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
    takes_measured = _request(outcome, i)
    if _plant_speaks(outcome, i):
        return False
    if not _measured(i):
        apply_event(outcome, _LOST)
        return False
    if not i.late_s <= p.late_tick:
        apply_event(outcome, _LATE)
    _watch_contact(outcome, i, p)
    _watch_clearance(outcome, i, p)
    if takes_measured and s.safety == _ENABLED:
        _take_measured(outcome, i, parameters)
        return True
    follows = tracking_distance(s.x, i.measured_q) <= p.tracking_error
    if not (
        follows
        and servo_tracking_distance(s, i.measured_servo, parameters) <= p.servo_tracking_error
    ):
        apply_event(outcome, _TRACKING)
    # A leader that opened its clutch or gave way to another has left; its age is no matter.
    leads = s.engaged != 0 and i.leader.clutch != 0 and i.leader.kind == s.leader_kind
    if leads and not i.leader.age_s <= i.leader.timeout_s:
        apply_event(outcome, _STALE)
    return False
