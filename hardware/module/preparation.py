"""Bringing the servos into the state that the cycle counts on, and back out of it.

EEPROM registers are written only where they differ, and never under torque: a servo under torque
that needs one is left alone and named. Nothing here takes torque off but :func:`release_all`.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from typing import NamedTuple

from hardware.module.errors import NeedsRelease, WrongModel
from hardware.servos.bus import Found, ServoBus
from hardware.servos.control_table import (
    MODEL_NUMBER,
    PRESENT,
    TABLE,
    TICKS_PER_TURN,
    WATCHDOG_UNIT_MS,
    HardwareError,
    OperatingMode,
)
from hardware.servos.errors import BusError, ServoSilent
from hardware.servos.protocol import BROADCAST
from robot.configuration import Servos

MODELS = (MODEL_NUMBER, 1090)
"""XL430-W250, and the 2XL430-W250, which is two of them in one case."""

_EEPROM = {
    "return_delay_time": 0,
    "drive_mode": 0,
    "operating_mode": int(OperatingMode.POSITION),
    "homing_offset": 0,
    "min_position_limit": 0,
    "max_position_limit": 4095,
    "shutdown": int(
        HardwareError.OVERHEATING | HardwareError.ELECTRICAL_SHOCK | HardwareError.OVERLOAD
    ),
}
_SILENT_LEVEL = TABLE["status_return_level"]
_VELOCITY_UNIT_DEG_S = TABLE["profile_velocity"].unit_scale * 6.0
_STATUS = (TABLE["torque_enable"].address, TABLE["bus_watchdog"].end)
_NEAR_TICKS = 17
"""A goal no further than this (1.5 degrees) from the one that carries the load is that one."""
_TICKS_PER_LOAD = 0.001 * 128.0 * 885.0 / TABLE["position_p_gain"].initial
"""The servo's loop drives it in proportion to what it is off: PWM = gain / 128 per tick."""

_RELEASE_TIMES = 3
_BOOT_S = 3.0
_BOOT_TIMES = 3


class ServoStatus(NamedTuple):
    """What a servo says of itself beside its measurements.

    Attributes:
        torque: whether it is under torque.
        error: its hardware errors.
        watchdog: register 98; ``WATCHDOG_TRIPPED`` after it has stopped the servo.
    """

    torque: bool
    error: HardwareError
    watchdog: int


class Prepared(NamedTuple):
    """Servos that are ready for the cycle.

    Attributes:
        found: who they are, in the order of the tendons.
        status: likewise, before anything was changed.
        position: ticks where they stand.
        goals: ticks that they were told, so that they stay there.
        fast: whether they know the fast sync read.
    """

    found: tuple[Found, ...]
    status: tuple[ServoStatus, ...]
    position: tuple[int, ...]
    goals: tuple[int, ...]
    fast: bool


def find_all(bus: ServoBus, ids: Sequence[int]) -> tuple[Found, ...]:
    """Ping the servos.

    Raises:
        ServoSilent: if one of them does not answer.
        WrongModel: if one of them is something else.
    """
    found = tuple(bus.ping(servo) for servo in ids)
    for servo in found:
        if servo.model not in MODELS:
            raise WrongModel(servo.id, servo.model)
    return found


def read_status(bus: ServoBus, servo: int, tries: int = 2) -> ServoStatus:
    """Torque, hardware errors and watchdog of one servo. Errors as :meth:`ServoBus.read`."""
    first, end = _STATUS
    data = bus.read_bytes(servo, first, end - first, tries).data

    def value(name: str) -> int:
        entry = TABLE[name]
        return entry.decode(data[entry.address - first : entry.end - first])

    error = HardwareError(value("hardware_error_status"))
    return ServoStatus(bool(value("torque_enable")), error, value("bus_watchdog"))


def prepare(bus: ServoBus, settings: Servos) -> Prepared:
    """Make four servos ready: settings, watchdog, goals where they stand. Torque stays as it is.

    Raises:
        BusError: if a servo does not answer or refuses.
        WrongModel: if one of them is something else.
        NeedsRelease: if a setting must be written for which its torque must go.
    """
    ids = settings.ids
    found = find_all(bus, ids)
    # A servo that does not confirm writes would seem to be silent.
    bus.write_unconfirmed(BROADCAST, _SILENT_LEVEL.name, 2)
    status = tuple(read_status(bus, servo) for servo in ids)
    for servo, state in zip(ids, status, strict=True):
        _write_eeprom(bus, servo, state.torque)
    velocity = max(1, round(settings.profile_velocity_deg_s / _VELOCITY_UNIT_DEG_S))
    for servo in ids:
        bus.write(servo, "profile_acceleration", 0)
        bus.write(servo, "profile_velocity", velocity)
    position = tuple(bus.read(servo, "present_position") for servo in ids)
    goals = tuple(
        _read_resting_goal(bus, servo, tick, state.torque)
        for servo, tick, state in zip(ids, position, status, strict=True)
    )
    units = max(1, settings.watchdog_ms // WATCHDOG_UNIT_MS)
    for servo, goal, state in zip(ids, goals, status, strict=True):
        # A servo that its watchdog has stopped takes no goal before it is cleared.
        bus.write(servo, "bus_watchdog", 0)
        if not state.error:
            bus.write(servo, "goal_position", goal)
        bus.write(servo, "bus_watchdog", units)
    size = PRESENT[1] - PRESENT[0]
    fast = len(bus.fast_sync_read(PRESENT[0], size, ids)) == len(ids)
    return Prepared(found, status, position, goals, fast)


def resting_goal(goal: int, position: int, load: int) -> int:
    """The goal that leaves a servo where it is, with the load that it carries there.

    Args:
        goal: ticks, the present one; kept if it is near.
        position: ticks.
        load: present load, as the register has it.
    """
    carrying = position + round(load * _TICKS_PER_LOAD)
    kept = goal if abs(goal - carrying) <= _NEAR_TICKS else carrying
    return min(max(kept, 0), TICKS_PER_TURN - 1)


def _read_resting_goal(bus: ServoBus, servo: int, position: int, torque: bool) -> int:
    if not torque:
        return resting_goal(position, position, 0)
    load = bus.read(servo, "present_load")
    return resting_goal(bus.read(servo, "goal_position"), position, load)


def _write_eeprom(bus: ServoBus, servo: int, torque: bool) -> None:
    wrong = [name for name, value in _EEPROM.items() if bus.read(servo, name) != value]
    if wrong and torque:
        raise NeedsRelease(servo, wrong)
    for name in wrong:
        bus.write(servo, name, _EEPROM[name])


def disarm_watchdogs(bus: ServoBus, ids: Sequence[int]) -> None:
    """Let the servos hold without the host, as before it leaves. Errors as ``write``."""
    for servo in ids:
        bus.write(servo, "bus_watchdog", 0)


def torque_on(bus: ServoBus, ids: Sequence[int]) -> None:
    """Hold where they stand. Errors as ``write``."""
    for servo in ids:
        bus.write(servo, "goal_position", bus.read(servo, "present_position"))
        bus.write(servo, "torque_enable", 1)


def release_all(bus: ServoBus, ids: Sequence[int]) -> list[int]:
    """Take torque off every servo, whatever any of them does or does not answer.

    Returns:
        Ids of the servos that did not confirm; they were told all the same.

    Raises:
        PortLost: if the port is gone.
    """
    for _ in range(_RELEASE_TIMES):
        bus.sync_write("torque_enable", [(servo, 0) for servo in ids])
    unsure = []
    for servo in ids:
        try:
            bus.write(servo, "torque_enable", 0)
        except BusError as error:
            if error.code == "servo_port_lost":
                raise
            unsure.append(servo)
    return unsure


def reboot_all(bus: ServoBus, ids: Sequence[int]) -> None:
    """Start every servo anew that tells of an error, and wait until they answer again.

    A servo that has switched itself off takes no other instruction. Starting anew loses torque, so
    all lose it: one tendon alone would bend the segment.

    Raises:
        BusError: if a servo does not come back.
    """
    release_all(bus, ids)
    for _ in range(_BOOT_TIMES):
        faulty = [servo for servo in ids if read_status(bus, servo).error]
        if not faulty:
            break
        for servo in faulty:
            # An answer that was lost says nothing; whether it starts anew is seen below.
            with contextlib.suppress(ServoSilent):
                bus.reboot(servo)
        _wait_for(bus, faulty)


def _wait_for(bus: ServoBus, ids: Sequence[int]) -> None:
    """Wait until servos that start anew answer; raises BusError where one does not."""
    deadline = time.monotonic() + _BOOT_S
    for servo in ids:
        while time.monotonic() < deadline:
            time.sleep(0.05)
            with contextlib.suppress(BusError):
                bus.ping(servo, tries=1)
                break
        bus.ping(servo)
