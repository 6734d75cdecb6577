"""The servos: who answers, at which speed, and how each of them is. They are only read."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

from hardware.module.preparation import MODELS, ServoStatus, read_status
from hardware.servos.bus import Found, ServoBus
from hardware.servos.control_table import (
    BAUD_RATES,
    PRESENT,
    WATCHDOG_TRIPPED,
    HardwareError,
)
from hardware.servos.errors import BusError, PortMissing, ServoSilent, fault_message
from hardware.servos.port import SerialPort
from robot.configuration import Servos
from server.doctor.finding import Finding, failure, fine, warning

_FAST_READ, _WATCHDOG = 45, 38
"""Firmware from which on there are fast sync reads, and the bus watchdog."""
_WARM_C = 10.0
_EXCHANGES = 25


class Health(NamedTuple):
    """What one servo says of itself.

    Attributes:
        status: torque, errors, watchdog.
        volt: supply.
        celsius: temperature.
        delay_us: return delay.
    """

    status: ServoStatus
    volt: float
    celsius: float
    delay_us: float


def examine(port: SerialPort, settings: Servos) -> list[Finding]:
    """Everything about the servos at one open port."""
    bus = ServoBus(port)
    found = {servo.id: servo for servo in bus.broadcast_ping()}
    for servo in settings.ids:
        # Answers of many can collide; alone each of them is heard.
        if servo not in found:
            try:
                found[servo] = bus.ping(servo)
            except ServoSilent:
                continue
    findings = _who(found, settings)
    delay_us = 0.0
    for servo in settings.ids:
        if servo in found:
            health, told = _servo(bus, found[servo], settings)
            findings += told
            delay_us += health.delay_us if health else 0.0
    if all(servo in found for servo in settings.ids):
        findings.append(_cycle(bus, found, settings, 1e-3 * delay_us))
    return findings


def _who(found: dict[int, Found], settings: Servos) -> list[Finding]:
    area, speed = "servos", f"{settings.baud_rate} baud"
    missing = [servo for servo in settings.ids if servo not in found]
    others = [servo for servo in sorted(found) if servo not in settings.ids]
    scan = "run `keyhole doctor --scan` to look for servos at every speed"
    findings: list[Finding] = []
    if len(missing) == len(settings.ids):
        findings.append(
            failure(
                area,
                f"none of {_list(settings.ids)} answers at {speed}",
                "they have no power, or another speed or other ids",
                f"switch their supply on; {scan}",
                missing=missing,
            )
        )
    elif missing:
        findings.append(
            failure(
                area,
                f"{_list(missing)} silent at {speed}",
                "the module does not move without all four",
                f"check the cable that leads to it; {scan}",
                missing=missing,
            )
        )
    else:
        what = f"{_list(settings.ids)} answer at {speed}"
        findings.append(fine(area, what, ids=list(settings.ids)))
    if others:
        findings.append(
            warning(
                area,
                f"{_list(others)} answer as well",
                "they are on the bus but not in the configuration",
                "take them off, or write their ids under [servos] ids",
                others=others,
            )
        )
    return findings


def _servo(bus: ServoBus, found: Found, settings: Servos) -> tuple[Health | None, list[Finding]]:
    area = f"servo {found.id}"
    try:
        health = Health(
            read_status(bus, found.id),
            bus.read(found.id, "present_input_voltage") / 10.0,
            float(bus.read(found.id, "present_temperature")),
            2.0 * bus.read(found.id, "return_delay_time"),
        )
    except BusError as error:
        return None, [
            failure(
                area,
                str(error),
                "it answered before and does not now, or not to this",
                "check its cable and the supply",
            )
        ]
    wrong = [*_firmware(area, found), *_state(area, found.id, health, settings)]
    if wrong:
        return health, wrong
    torque = "under torque" if health.status.torque else "without torque"
    what = f"firmware {found.firmware}, {health.volt:.1f} V, {health.celsius:.0f} °C, {torque}"
    data = {"firmware": found.firmware, "volt": health.volt, "celsius": health.celsius}
    return health, [fine(area, what, torque=health.status.torque, **data)]


def _firmware(area: str, found: Found) -> list[Finding]:
    findings: list[Finding] = []
    if found.model not in MODELS:
        findings.append(
            failure(
                area,
                f"is of model {found.model}",
                "registers and loads of another servo mean something else",
                "use an XL430-W250 (model 1060)",
                model=found.model,
            )
        )
    if found.firmware < _WATCHDOG:
        findings.append(
            failure(
                area,
                f"firmware {found.firmware} has no bus watchdog",
                "it would go on moving when the host dies",
                f"update it to {_FAST_READ} or newer with the vendor's DYNAMIXEL Wizard",
                firmware=found.firmware,
            )
        )
    elif found.firmware < _FAST_READ:
        findings.append(
            warning(
                area,
                f"firmware {found.firmware} has no fast sync read",
                "the slower sync read is used",
                f"update it to {_FAST_READ} or newer with the vendor's DYNAMIXEL Wizard",
                firmware=found.firmware,
            )
        )
    return findings


def _state(area: str, number: int, health: Health, settings: Servos) -> list[Finding]:
    findings: list[Finding] = []
    low, high = settings.voltage_min_v, settings.voltage_max_v
    if not low <= health.volt <= high:
        findings.append(
            failure(
                area,
                f"{health.volt:.1f} V at its connector; {low:.1f} to {high:.1f} V are allowed",
                "it is weak or will be damaged, and the module refuses to move",
                "use a 12 V supply, and look for a thin or loose power cable",
                volt=health.volt,
            )
        )
    limit = settings.temperature_limit_c
    if health.celsius > limit - _WARM_C:
        hot = health.celsius > limit
        findings.append(
            (failure if hot else warning)(
                area,
                f"{health.celsius:.0f} °C; {limit:.0f} °C are allowed",
                "it stops by itself when it gets hotter" if not hot else "it is not moved",
                "let it cool down without torque, and look for a tendon that is too tight",
                celsius=health.celsius,
            )
        )
    if health.status.error:
        findings.append(
            failure(
                area,
                fault_message(number, health.status.error).split("; ")[0].partition(": ")[2],
                "it has stopped and refuses torque until it is started anew"
                if health.status.error != HardwareError.INPUT_VOLTAGE
                else "it says so in every answer until it is started anew",
                "remove the cause, then reboot the servos from the page, or switch their supply "
                "off and on",
                hardware_error=int(health.status.error),
            )
        )
    if health.status.watchdog == WATCHDOG_TRIPPED:
        findings.append(
            warning(
                area,
                "its watchdog has stopped it",
                "the program that drove it died or was too slow",
                "connect again: the console clears it",
            )
        )
    return findings


def _cycle(bus: ServoBus, found: dict[int, Found], settings: Servos, delay_ms: float) -> Finding:
    """How fast all four can be read, by this machine and this adapter.

    Args:
        bus: asks.
        found: firmware of each.
        settings: ids and wanted rate.
        delay_ms: return delays of all of them, which the console sets to nothing.
    """
    area = "bus"
    fast = all(found[servo].firmware >= _FAST_READ for servo in settings.ids)
    read = bus.fast_sync_read if fast else bus.sync_read
    begin, end = PRESENT
    durations: list[float] = []
    whole = 0
    for _ in range(_EXCHANGES):
        start = time.monotonic()
        whole += len(read(begin, end - begin, settings.ids)) == len(settings.ids)
        durations.append(1e3 * (time.monotonic() - start))
    median = max(statistics.median(durations) - delay_ms, 0.0)
    wanted = 1e3 / settings.rate_hz
    data = {"read_ms": median, "return_delay_ms": delay_ms, "whole": whole, "of": _EXCHANGES}
    if whole < _EXCHANGES:
        return failure(
            area,
            f"{_EXCHANGES - whole} of {_EXCHANGES} answers were lost or damaged",
            "two in a row stop the motion",
            "shorten the cable, check its plugs, and keep it away from motor cables",
            **data,
        )
    if median > wanted:
        return warning(
            area,
            f"reading all servos takes {median:.1f} ms; {wanted:.1f} ms are wanted",
            "the module is updated more slowly than [servos] rate_hz says",
            "raise the servos' speed with the vendor's DYNAMIXEL Wizard, see to the adapter's "
            "latency, or lower [servos] rate_hz",
            **data,
        )
    return fine(area, f"reading all servos takes {median:.1f} ms without return delay", **data)


def scan(path: str, settings: Servos, say: Callable[[str], None] = lambda _: None) -> list[Finding]:
    """Look for servos at every speed that they know; takes about a second for each.

    Args:
        path: of the port; nobody else may have it open.
        settings: what is expected.
        say: told what is being done.
    """
    heard: dict[int, list[int]] = {}
    for baud_rate in BAUD_RATES:
        say(f"listening at {baud_rate} baud")
        try:
            port = SerialPort(path, baud_rate)
        except PortMissing:
            continue
        try:
            found = ServoBus(port).broadcast_ping()
        except BusError:
            found = []
        finally:
            port.close()
        if found:
            heard[baud_rate] = sorted(servo.id for servo in found)
    if not heard:
        return [
            failure(
                "scan",
                "no servo answers at any speed",
                "they have no power, or no connection to the adapter",
                "switch their supply on; check the cable between adapter and first servo",
            )
        ]
    return [_heard(baud_rate, ids, settings) for baud_rate, ids in heard.items()]


def _heard(baud_rate: int, ids: list[int], settings: Servos) -> Finding:
    what = f"{_list(ids)} at {baud_rate} baud"
    if baud_rate == settings.baud_rate and set(ids) >= set(settings.ids):
        return fine("scan", what, baud_rate=baud_rate, ids=ids)
    advice = "give the servos the configured ids and speed with the vendor's DYNAMIXEL Wizard"
    if len(ids) >= len(settings.ids):
        advice += f", or write baud_rate = {baud_rate} and ids = {ids} under [servos]"
    return warning(
        "scan",
        what,
        f"the configuration expects {_list(settings.ids)} at {settings.baud_rate} baud",
        advice,
        baud_rate=baud_rate,
        ids=ids,
    )


def _list(ids: list[int] | tuple[int, ...]) -> str:
    return (
        "servo " + ", ".join(map(str, ids))
        if len(ids) == 1
        else ("servos " + ", ".join(map(str, ids)))
    )
