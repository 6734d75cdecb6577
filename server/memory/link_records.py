"""What passes between the web process, the control process and the supervisor, as record types.

Every mapped file has one writing process. All times are the host's monotonic clock in nanoseconds,
which is the same in every process.
"""

from __future__ import annotations

from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from hardware.devices import DEVICES
from robot.records import INSTRUMENT, LEADER, LeaderKind, RecordTypes
from server.memory.mapped import MappedRing, MappedSlot
from server.memory.recording_link import create_recording_files
from server.memory.stylus_records import create_stylus_files

SETTINGS_CHANGE = 100
PATH_START = 101
PATH_STOP = 102
TROCAR_CHANGE = 103
BREATHING_CHANGE = 104
BOARD_CHANGE = 105
HOME = 106
RELEASE_TORQUE = 107
TAKE_HOLD = 108
REBOOT_DEVICES = 109
INJECT_FAULT = 110
"""Kinds of :func:`request_message` beside those of :class:`robot.records.Request`."""


class Phase(IntEnum):
    """How far the control process is, as it says itself."""

    STARTING = 0
    RUNNING = 1
    FAILED = 2
    ENDED = 3


class ControlState(IntEnum):
    """The control process as the supervisor sees it."""

    STARTING = 0
    RUNNING = 1
    DOWN = 2


class TrocarSource(IntEnum):
    """How the trocar came to be where it is taken to be."""

    CONFIGURATION = 0
    TOUCH = 1
    ENTER = 2


def request_message(types: RecordTypes) -> np.dtype[Any]:
    """Web to control: a Request or one of the kinds above, with the fields that belong to it: SI,
    base frame; ``board`` is a place in ``scenes.boards.board.BOARD_NAMES``; ``fault`` is one of
    those of ``hardware.faulty_plant``, or empty to clear them.
    """
    return np.dtype(
        [
            ("sequence", "i8"),
            ("kind", "i8"),
            ("path_id", "i8"),
            ("path_rows", "i8"),
            ("path_locks_arm", "i8"),
            ("stamp_ns", "i8"),
            ("settings", types.settings),
            ("trocar_source", "i8"),
            ("trocar_position", "f8", 3),
            ("breathing_amplitude", "f8"),
            ("breathing_period", "f8"),
            ("board", "i8"),
            ("fault", "S32"),
        ]
    )


EMERGENCY = np.dtype([("count", "i8"), ("stamp_ns", "i8")])
"""Web to control: a press of the emergency stop. That it was written at all is the press."""

LEADER_SLOT = np.dtype([("leader", LEADER), ("stamp_ns", "i8")])
"""Leader to control: the newest sample of one leader; ``age_s`` is computed on the other side."""

HOLD_SLOT = np.dtype([("down", "i8"), ("stamp_ns", "i8")])
"""Web to control: whether the hold-to-move control is pressed."""

ALIVE = np.dtype([("stamp_ns", "i8")])
"""Web to control: the web server's event loop was alive at this time."""

STATUS = np.dtype(
    [
        ("phase", "i8"),
        ("pid", "i8"),
        ("rate_hz", "f8"),
        ("stamp_ns", "i8"),
        ("realtime", "S192"),
        ("plant", "S32"),
        ("board", "S32"),
        ("trocar_source", "i8"),
        ("trocar_registered", "f8", 3),
        ("breathing_amplitude", "f8"),
        ("breathing_period", "f8"),
        ("message", "S256"),
    ]
)
"""Control to all: what changes rarely. Written at such a change, never in an ordinary tick."""

SUPERVISION = np.dtype(
    [
        ("control", "i8"),
        ("control_pid", "i8"),
        ("web_pid", "i8"),
        ("control_restarts", "i8"),
        ("web_restarts", "i8"),
        ("stamp_ns", "i8"),
        ("message", "S256"),
    ]
)
"""Supervisor to all: which processes are up (their ids, else 0), and why one was restarted."""

RECORD_SLOT_FILE = "record.slot"
RECORD_RING_FILE = "record.ring"
REQUEST_FILE = "request.ring"
EMERGENCY_FILE = "emergency.slot"
HOLD_FILE = "hold.slot"
ALIVE_FILE = "alive.slot"
STATUS_FILE = "status.slot"
SUPERVISION_FILE = "supervision.slot"
DEVICES_FILE = "devices.slot"
WEB_LEADER_KINDS = (
    LeaderKind.GIZMO,
    LeaderKind.API_POSE,
    LeaderKind.API_TARGET,
    LeaderKind.GAMEPAD,
)
"""The leaders whose samples always come from the web process."""

LEADER_KINDS = (*WEB_LEADER_KINDS, LeaderKind.STYLUS)
"""All whose samples come from outside control; a path is played by control itself. The stylus'
come from the leader process, or from the web process where there is none."""

REQUEST_CAPACITY = 1024

PATH_COLUMNS = 8
"""Time in s, position in m, quaternion w, x, y, z."""


def leader_file(kind: LeaderKind) -> str:
    """Name of the mapped file of a leader's newest sample."""
    return f"leader_{kind.name.lower()}.slot"


def path_file(path_id: int) -> str:
    """Name of the file that holds a path's spline as plain float64."""
    return f"path_{path_id}.f8"


def create_mapped_files(
    directory: Path, rate_hz: float, ring_seconds: float, types: RecordTypes = INSTRUMENT
) -> None:
    """Make every mapped file of a console, replacing those that exist.

    Args:
        directory: the run directory.
        rate_hz: rate of the control loop.
        ring_seconds: how long the ring of records reaches back.
        types: of the robot.

    Raises:
        MappedFileError: there is no room for them.
    """
    slots = {
        RECORD_SLOT_FILE: types.record,
        EMERGENCY_FILE: EMERGENCY,
        HOLD_FILE: HOLD_SLOT,
        ALIVE_FILE: ALIVE,
        STATUS_FILE: STATUS,
        DEVICES_FILE: DEVICES,
        SUPERVISION_FILE: SUPERVISION,
    }
    slots.update({leader_file(kind): LEADER_SLOT for kind in LEADER_KINDS})
    for name, dtype in slots.items():
        MappedSlot(directory / name, dtype, create=True).close()
    capacity = max(2, round(rate_hz * ring_seconds))
    MappedRing(directory / RECORD_RING_FILE, types.record, capacity, create=True).close()
    requests = request_message(types)
    MappedRing(directory / REQUEST_FILE, requests, REQUEST_CAPACITY, create=True).close()
    create_recording_files(directory)
    create_stylus_files(directory)
