"""Serial ports: which there are, whether we may open them, and how long their adapters dawdle."""

from __future__ import annotations

import grp
import os
from pathlib import Path

from hardware.servos.errors import PortMissing
from hardware.servos.port import SerialPort, candidates, latency_timer_ms
from server.doctor.finding import Finding, failure, fine, warning

_SLOW_TIMER_MS = 2


def find(wanted: str, needed: bool) -> tuple[list[str], list[Finding]]:
    """Ports that may hold the servos and that we are allowed to open.

    Args:
        wanted: as in the configuration: "auto", a path, or a pattern.
        needed: whether the configuration says that hardware is connected.
    """
    paths = candidates(wanted)
    if not paths:
        return [], [_missing(wanted, needed)]
    findings: list[Finding] = []
    allowed = []
    for path in paths:
        if os.access(path, os.R_OK | os.W_OK):
            allowed.append(path)
        else:
            findings.append(_forbidden(path))
    if allowed:
        findings.insert(0, fine("serial port", ", ".join(allowed), paths=allowed))
    return allowed, findings


def _missing(wanted: str, needed: bool) -> Finding:
    what = (
        "no USB serial adapter was found"
        if wanted == "auto"
        else f"{wanted}: there is no such port"
    )
    advice = (
        "plug the adapter in (a U2D2 appears as /dev/ttyUSB0), or name its port under [servos] port"
    )
    if needed:
        return failure("serial port", what, "the servos cannot be reached", advice)
    return warning("serial port", what, "only the simulated robot can be driven", advice)


def _forbidden(path: str) -> Finding:
    group = _group(path)
    return failure(
        "serial port",
        f"{path}: no permission to read and write",
        "the servos cannot be reached",
        f"join its group: sudo usermod -aG {group} $USER, then log out and in again",
        path=path,
        group=group,
    )


def _group(path: str) -> str:
    try:
        return grp.getgrgid(Path(path).stat().st_gid).gr_name
    except (KeyError, OSError):
        return "dialout"


def open_port(path: str, baud_rate: int) -> tuple[SerialPort | None, list[Finding]]:
    """Open one port, and say how fast it hands bytes on."""
    try:
        port = SerialPort(path, baud_rate)
    except PortMissing as error:
        return None, [
            failure(
                "serial port",
                f"{path}: {error.reason}",
                "another program may be using it",
                "end the console or the other program, then run the doctor again",
                path=path,
            )
        ]
    return port, [_latency(port)]


def _latency(port: SerialPort) -> Finding:
    area, timer = "adapter latency", latency_timer_ms(port.path)
    if timer is not None and timer > _SLOW_TIMER_MS:
        device = Path(os.path.realpath(port.path)).name
        place = f"/sys/bus/usb-serial/devices/{device}/latency_timer"
        return warning(
            area,
            f"{port.path}: bytes are kept for up to {timer} ms",
            f"the servos cannot be cycled faster than {1000 / timer:.0f} times a second",
            f"as root: echo 1 > {place}; or let udev do it: "
            'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"',
            latency_timer_ms=timer,
        )
    if timer is None and not port.low_latency:
        return fine(area, f"{port.path}: has no latency timer")
    shown = "low-latency mode" if timer is None else f"{timer} ms"
    return fine(area, f"{port.path}: {shown}", latency_timer_ms=timer)
