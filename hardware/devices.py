"""What a plant tells people about its devices: for the page and the API, never for control."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from robot.records import SERVOS

TEXT = 128
"""Bytes of the longest message."""


class DeviceState(IntEnum):
    """How far a device is."""

    SIMULATED = 0
    SEARCHING = 1
    PREPARING = 2
    CONNECTED = 3
    HOMING = 4
    FAULT = 5


SERVO = np.dtype(
    [
        ("id", "i8"),
        ("answers", "i8"),
        ("model", "i8"),
        ("firmware", "i8"),
        ("torque", "i8"),
        ("hardware_error", "i8"),
        ("position_deg", "f8"),
        ("load_percent", "f8"),
        ("voltage_v", "f8"),
        ("temperature_c", "f8"),
        ("age_ms", "f8"),
    ]
)
"""One servo. ``position_deg`` from the straight segment; ``hardware_error``: its bits."""

BUS = np.dtype(
    [
        ("state", "i8"),
        ("homed", "i8"),
        ("homing_progress", "f8"),
        ("baud_rate", "i8"),
        ("rate_hz", "f8"),
        ("cycle_median_ms", "f8"),
        ("cycle_p99_ms", "f8"),
        ("cpu_percent", "f8"),
        ("cycles", "i8"),
        ("missed", "i8"),
        ("bad_packets", "i8"),
        ("reconnects", "i8"),
        ("port", f"S{TEXT}"),
        ("message", f"S{TEXT}"),
        ("servos", SERVO, SERVOS),
    ]
)
"""The instrument module's servo bus. ``cycles`` that were complete, ``missed`` that were not."""

ARM = np.dtype(
    [
        ("state", "i8"),
        ("error", "i8"),
        ("warning", "i8"),
        ("rate_hz", "f8"),
        ("age_ms", "f8"),
        ("reconnects", "i8"),
        ("kind", "S16"),
        ("address", f"S{TEXT}"),
        ("message", f"S{TEXT}"),
    ]
)
"""The arm. ``kind``: simulated, locked or xarm; ``error`` and ``warning``: its codes."""

DEVICES = np.dtype([("bus", BUS), ("arm", ARM)])
"""Everything with a wire. All zero (``SIMULATED``) where nothing has one."""
