"""What the leader process tells of its stylus, as a record type and its mapped file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from server.memory.mapped import MappedSlot

STYLUS_COUNTS = (
    "samples",
    "malformed",
    "oversized",
    "wrong_topic",
    "invalid",
    "repeated",
    "out_of_order",
    "late",
    "buttons_dead",
)
"""What is counted of what comes from a stylus."""

STYLUS_STATUS = np.dtype(
    [
        ("pid", "i8"),
        ("connected", "i8"),
        ("stamp_ns", "i8"),
        ("sample_ns", "i8"),
        ("delay_ns", "i8"),
        ("rate_hz", "f8"),
        ("clutch", "i8"),
        ("mode", "i8"),
        ("buttons", "i8"),
        ("buttons_repeat", "i8"),
        ("force_n", "f8"),
        ("counts", [(name, "i8") for name in STYLUS_COUNTS]),
        ("url", "S256"),
        ("message", "S256"),
    ]
)
"""Leader process to all: ``stamp_ns`` of this record, ``sample_ns`` of the newest good sample
(host's monotonic clock), ``delay_ns``: of the slowest of late, above the quickest; ``mode``: a
``robot.records.DriveMode``; ``buttons``: bit 0 the first; ``buttons_repeat``: whether the driver
repeats them."""

STYLUS_STATUS_FILE = "stylus.slot"


def create_stylus_files(directory: Path) -> None:
    """Make the mapped file, replacing one that exists.

    Raises:
        MappedFileError: there is no room for it.
    """
    MappedSlot(directory / STYLUS_STATUS_FILE, STYLUS_STATUS, create=True).close()
