"""The forms of the reports that an xArm's controller sends by itself, as packed numpy types.

Every report begins with its own length. Integers are big-endian, floats little-endian; angles are
in rad, positions in mm. Both ends use these types: the reader and the fake controller.
"""

from __future__ import annotations

import numpy as np

REAL = np.dtype(
    [
        ("length", ">u4"),
        ("state_and_mode", "u1"),
        ("commands", ">u2"),
        ("q", "<f4", 7),
        ("pose", "<f4", 6),
        ("torque", "<f4", 7),
        ("force", "<f4", 6),
        ("raw_force", "<f4", 6),
    ]
)
"""100 Hz. ``state_and_mode``: low and high four bits; ``pose``: x, y, z, roll, pitch, yaw."""

_HEAD = [(name, REAL[name]) for name in ("length", "state_and_mode", "commands", "q", "pose")]

NORMAL = np.dtype(
    [
        *_HEAD,
        ("torque", "<f4", 7),
        ("brakes", "u1"),
        ("enabled", "u1"),
        ("error", "u1"),
        ("warning", "u1"),
        ("tcp_offset", "<f4", 6),
        ("payload", "<f4", 4),
        ("collision_sensitivity", "u1"),
        ("teaching_sensitivity", "u1"),
        ("gravity", "<f4", 3),
    ]
)
"""5 Hz. ``brakes`` and ``enabled``: a bit for each joint, set where it may move."""

RICH = np.dtype(
    [
        *[(name, NORMAL[name]) for name in NORMAL.names or ()],
        ("arm_type", "u1"),
        ("axes", "u1"),
        ("ids", "u1", 4),
        ("version", "S30"),
        ("tcp_limits", "<f4", 5),
        ("joint_limits", "<f4", 5),
        ("rotation_limits", "<f4", 2),
        ("joint_errors", "u1", 16),
        ("temperature_c", "i1", 7),
        ("tcp_speed", "<f4"),
        ("speed", "<f4", 7),
        ("counter", ">u4"),
        ("world_offset", "<f4", 6),
        ("resets", "u1", 2),
    ]
)
"""5 Hz: the older of its forms, which every version of the vendor's library reads."""

SHORTEST, LONGEST = 35, 1024
"""Bytes between which a report's length must be to be believed."""
