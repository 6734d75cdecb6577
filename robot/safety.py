"""The safety states: one printed table of transitions, applied at the start of every tick.

It fails closed: what the table does not list is refused and changes nothing; leaving FAULT takes an
explicit RESET and leads to DISABLED, never to motion. What is here serves every robot; what only
one of them can measure is watched in a module of its own beside it.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from robot.compiled import compiled
from robot.errors import KeyholeError
from robot.records import RecordFields, Request, Safety


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
    NEAR_SNAPPING = 25
    RELATIVE_ERROR = 26
    TENSION_UNKNOWN = 27
    TENDON_RUNS = 28


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
    Transition(_E, Event.NEAR_SNAPPING, _P),
    Transition(_E, Event.RELATIVE_ERROR, _P),
    Transition(_E, Event.TENSION_UNKNOWN, _P),
    Transition(_E, Event.TENDON_RUNS, _F),
    Transition(_P, Event.TENDON_RUNS, _F),
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
    Event.NEAR_SNAPPING: (
        "the tubes are about to snap",
        "enable, then move back the way it came",
    ),
    Event.RELATIVE_ERROR: (
        "arm B cannot keep its place beside arm A",
        "enable, then move back or more slowly",
    ),
    Event.TENSION_UNKNOWN: (
        "a torque cell gives no usable reading, and tendons were to hold a tension",
        "mend the cell or hold positions, then enable",
    ),
    Event.TENDON_RUNS: (
        "a tendon that holds its tension ran away: broken, slipped, or pushed too far",
        "look at the tendon; hold positions if it is whole; then reset",
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
_DISABLED, _ENABLED, _PAUSED = int(_D), int(_E), int(_P)
_ENABLE, _STALE = int(Event.ENABLE), int(Event.LEADER_STALE)
_BUS_LOST, _ARM_LOST, _BACK = int(Event.BUS_LOST), int(Event.ARM_LOST), int(Event.DEVICES_BACK)
_LATE = int(Event.CONTROL_LATE)
MEASUREMENT_TIMEOUT_S = 0.025
"""A measurement is lost when it is older than this, and older than a tick and a half."""


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
def take_request(outcome: np.ndarray, i: RecordFields) -> bool:
    """Apply this tick's request; True if the robot must take the measured axes as its own.

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
def plant_speaks(outcome: np.ndarray, i: RecordFields) -> bool:
    """Apply what the plant tells, or that all its devices are back; True if it tells anything."""
    s = outcome[0].state
    if i.plant_event != 0:
        apply_event(outcome, i.plant_event)
        return True
    if s.reason in (_BUS_LOST, _ARM_LOST) and i.readiness == 0:
        apply_event(outcome, _BACK)
    return False


@compiled
def is_recent(i: RecordFields) -> bool:
    """Whether the measurement is valid and recent, as far as the plant knows."""
    oldest = max(MEASUREMENT_TIMEOUT_S, 1.5 * i.dt_s)
    return bool(i.measured_valid != 0 and i.measured_age_s <= oldest)


@compiled
def watch_lateness(outcome: np.ndarray, i: RecordFields, latest_s: float) -> None:
    """Pause after a tick that began more than ``latest_s`` after its deadline."""
    if not i.late_s <= latest_s:
        apply_event(outcome, _LATE)


@compiled
def watch_leader(outcome: np.ndarray, i: RecordFields) -> None:
    """Pause where the leader that leads has gone silent.

    A leader that opened its clutch or gave way to another has left; its age is no matter.
    """
    s = outcome[0].state
    leads = s.engaged != 0 and i.leader.clutch != 0 and i.leader.kind == s.leader_kind
    if leads and not i.leader.age_s <= i.leader.timeout_s:
        apply_event(outcome, _STALE)
