"""What people are told of the devices and of the robot's readiness, from SI and bits into words."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.devices import DeviceState
from hardware.servos.control_table import HardwareError
from hardware.servos.errors import fault_message
from robot.clearance import PART_NAMES, Part
from robot.records import Readiness

READINESS: dict[Readiness, tuple[str, str]] = {
    Readiness.READY: ("ready", ""),
    Readiness.NOT_CONNECTED: (
        "a device is not connected",
        "look under Devices which; plug it in, it is found by itself",
    ),
    Readiness.NOT_HOMED: ("the instrument is not homed", "press Home under Devices"),
    Readiness.BUSY: ("a device is being prepared or homed", "wait until it is done"),
    Readiness.TORQUE_OFF: ("the torque is off", "press Take hold under Devices"),
    Readiness.DEVICE_FAULT: (
        "a device reports a fault",
        "read which under Devices, take the cause away, then reboot it",
    ),
    Readiness.OUTSIDE_LIMITS: (
        "a joint or a servo stands outside its limits",
        "bring it inside by hand, or home the instrument",
    ),
}
"""For each readiness: what stands against enabling, and what to do."""


_NOT_READ = dict.fromkeys(
    ("position_deg", "load_percent", "voltage_v", "temperature_c", "age_ms"), math.nan
)


def readiness_view(value: int) -> dict[str, str]:
    """Readiness as the state message tells it."""
    readiness = Readiness(value) if value in set(Readiness) else Readiness.BUSY
    reason, action = READINESS[readiness]
    return {"state": readiness.name.lower(), "reason": reason, "action": action}


def clearance_view(state: np.void, limit_m: float) -> dict[str, Any]:
    """The smallest distance between arm, module, shaft and body wall, and between which."""
    part = int(state["clearance_part"])
    known = part in set(Part) and part != Part.NONE
    return {
        "distance_mm": _rounded(float(state["clearance"]) * 1e3, 2) if known else None,
        "between": PART_NAMES[Part(part)] if known else None,
        "limit_mm": _rounded(limit_m * 1e3, 3),
    }


def devices_view(devices: NDArray[Any], connected: bool) -> dict[str, Any]:
    """The (1,) DEVICES in words and people's units.

    Args:
        devices: what the plant told last.
        connected: whether parts of the robot are real.
    """
    bus, arm = devices["bus"][0], devices["arm"][0]
    return {
        "simulated": not connected,
        "bus": _bus(bus) if bus["state"] != DeviceState.SIMULATED else None,
        "arm": _arm(arm) if bytes(arm["kind"]) else None,
    }


def _bus(bus: np.void) -> dict[str, Any]:
    return {
        "state": _state(bus["state"]),
        "port": _text(bus["port"]),
        "message": _text(bus["message"]),
        "homed": bool(bus["homed"]),
        "homing_progress": _rounded(float(bus["homing_progress"]), 3),
        "baud_rate": int(bus["baud_rate"]),
        "rate_hz": _rounded(float(bus["rate_hz"]), 1),
        "cycle_median_ms": _rounded(float(bus["cycle_median_ms"]), 3),
        "cycle_p99_ms": _rounded(float(bus["cycle_p99_ms"]), 3),
        "cpu_percent": _rounded(float(bus["cpu_percent"]), 1),
        "cycles": int(bus["cycles"]),
        "missed": int(bus["missed"]),
        "bad_packets": int(bus["bad_packets"]),
        "reconnects": int(bus["reconnects"]),
        "servos": [_servo(servo) for servo in bus["servos"]],
    }


def _servo(servo: np.void) -> dict[str, Any]:
    bits = int(servo["hardware_error"])
    identity = int(servo["id"])
    # A servo that has never answered has told nothing, and its zeros are none.
    known = bool(servo["answers"]) or float(servo["voltage_v"]) > 0.0
    read = servo if known else _NOT_READ
    return {
        "id": identity,
        "answers": bool(servo["answers"]),
        "torque": bool(servo["torque"]),
        "firmware": int(servo["firmware"]) if known else None,
        "position_deg": _rounded(float(read["position_deg"]), 2),
        "load_percent": _rounded(float(read["load_percent"]), 1),
        "voltage_v": _rounded(float(read["voltage_v"]), 1),
        "temperature_c": _rounded(float(read["temperature_c"]), 1),
        "age_ms": _rounded(float(read["age_ms"]), 1),
        "error": fault_message(identity, HardwareError(bits)) if bits else None,
    }


def _arm(arm: np.void) -> dict[str, Any]:
    return {
        "kind": _text(arm["kind"]),
        "state": _state(arm["state"]),
        "address": _text(arm["address"]),
        "message": _text(arm["message"]),
        "error": int(arm["error"]),
        "warning": int(arm["warning"]),
        "rate_hz": _rounded(float(arm["rate_hz"]), 1),
        "age_ms": _rounded(float(arm["age_ms"]), 1),
        "reconnects": int(arm["reconnects"]),
    }


def _state(value: Any) -> str:
    return DeviceState(int(value)).name.lower()


def _text(value: Any) -> str:
    return bytes(value).decode(errors="replace")


def _rounded(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None
