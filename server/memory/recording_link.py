"""Between those who want a recording and the recorder process: one slot in each direction."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np

from server.memory.mapped import MappedReadError, MappedSlot

RECORDING_REQUEST = np.dtype(
    [("number", "i8"), ("start", "i8"), ("stamp_ns", "i8"), ("path", "S1024")]
)
"""To the recorder: record into ``path`` (``start`` 1), or stop. ``number`` grows with each."""

RECORDING = np.dtype(
    [
        ("state", "i8"),
        ("answered", "i8"),
        ("pid", "i8"),
        ("size", "i8"),
        ("ticks", "i8"),
        ("gaps", "i8"),
        ("lost", "i8"),
        ("duration_ns", "i8"),
        ("next_sequence", "i8"),
        ("stamp_ns", "i8"),
        ("path", "S1024"),
        ("message", "S512"),
    ]
)
"""The recorder to all: the present recording, or the last. ``next_sequence`` is the number in the
ring of the first record that is not yet in the file; a recorder started anew goes on there."""

RECORDING_REQUEST_FILE = "recording_request.slot"
RECORDING_FILE = "recording.slot"
LONGEST_PATH = 1000
SILENT_NS = 5_000_000_000
"""A recorder that has said nothing for so long does not record."""


class RecordingState(IntEnum):
    """What the recorder does."""

    IDLE = 0
    RECORDING = 1
    FAILED = 2


@dataclass(frozen=True)
class RecordingStatus:
    """The present recording, or the last one.

    Attributes:
        state: of the recorder.
        answered: number of the last request that it has followed.
        path: the file; None before the first recording.
        size: bytes in the file. ticks: records in it.
        duration_s: from the first record to the newest.
        gaps: how often records are missing. lost: how many are.
        message: why it failed, or what else there is to know.
        next_sequence: see :data:`RECORDING`.
        alive: whether the recorder has said something lately.
        pid: its process.
    """

    state: RecordingState = RecordingState.IDLE
    answered: int = 0
    path: Path | None = None
    size: int = 0
    ticks: int = 0
    duration_s: float = 0.0
    gaps: int = 0
    lost: int = 0
    message: str = ""
    next_sequence: int = 0
    alive: bool = False
    pid: int = 0

    @property
    def records(self) -> bool:
        """Whether records are being written down now."""
        return self.alive and self.state == RecordingState.RECORDING


def create_recording_files(directory: Path) -> None:
    """Make both slots of a console.

    Raises:
        MappedFileError: there is no room for them.
    """
    MappedSlot(directory / RECORDING_REQUEST_FILE, RECORDING_REQUEST, create=True).close()
    MappedSlot(directory / RECORDING_FILE, RECORDING, create=True).close()


class RecordingLink:
    """The side that asks for recordings. One process asks, from any thread.

    Args:
        directory: the run directory.

    Raises:
        MappedFileError: no console with a recorder keeps its files there.
    """

    def __init__(self, directory: Path) -> None:
        self._lock = threading.Lock()
        self._request = MappedSlot(
            directory / RECORDING_REQUEST_FILE, RECORDING_REQUEST, writable=True
        )
        self._status = MappedSlot(directory / RECORDING_FILE, RECORDING)

    def start(self, path: Path) -> int:
        """Ask for a recording into ``path``; returns the number to wait for."""
        return self._ask(1, os.fsencode(path))

    def stop(self) -> int:
        """Ask for its end; returns the number to wait for."""
        return self._ask(0, b"")

    def _ask(self, start: int, path: bytes) -> int:
        with self._lock:
            request = np.zeros(1, RECORDING_REQUEST)
            number = self._request.sequence + 1
            request["number"], request["start"], request["path"] = number, start, path
            request["stamp_ns"] = time.monotonic_ns()
            self._request.write(request)
            return number

    def status(self) -> RecordingStatus:
        """The present recording, or the last one."""
        return read_status(self._status)

    def close(self) -> None:
        """Unmap both files."""
        self._request.close()
        self._status.close()


def read_status(slot: MappedSlot) -> RecordingStatus:
    """What the recorder said last."""
    try:
        said = slot.read()[0]
    except MappedReadError:
        return RecordingStatus()
    path = bytes(said["path"])
    return RecordingStatus(
        state=RecordingState(int(said["state"])),
        answered=int(said["answered"]),
        path=Path(os.fsdecode(path)) if path else None,
        size=int(said["size"]),
        ticks=int(said["ticks"]),
        duration_s=int(said["duration_ns"]) * 1e-9,
        gaps=int(said["gaps"]),
        lost=int(said["lost"]),
        message=said["message"].decode(errors="replace"),
        next_sequence=int(said["next_sequence"]),
        alive=time.monotonic_ns() - int(said["stamp_ns"]) < SILENT_NS,
        pid=int(said["pid"]),
    )
