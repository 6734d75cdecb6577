"""Between those who watch a recording and the process that shows it: one slot in each direction."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from server.memory.mapped import MappedReadError, MappedSlot

REPLAY_REQUEST = np.dtype(
    [("number", "i8"), ("time_s", "f8"), ("playing", "i8"), ("speed", "f8"), ("stamp_ns", "i8")]
)
"""To the replay: go to ``time_s``, play (1) or pause (0), at ``speed``. NaN and -1 leave it."""

REPLAY = np.dtype(
    [
        ("answered", "i8"),
        ("time_s", "f8"),
        ("duration_s", "f8"),
        ("playing", "i8"),
        ("speed", "f8"),
        ("started_ns", "i8"),
        ("cut", "i8"),
        ("stamp_ns", "i8"),
        ("path", "S1024"),
    ]
)
"""The replay to all: what it shows. ``started_ns``: when the recording began, since 1970."""

REPLAY_REQUEST_FILE = "replay_request.slot"
REPLAY_FILE = "replay.slot"


@dataclass(frozen=True)
class ReplayStatus:
    """What is shown.

    Attributes:
        time_s: since the start of the recording; duration_s: of the whole.
        playing: whether it goes on by itself. speed: recorded time over real time.
        started_ns: when the recording began, ns since 1970.
        cut: whether the recording was cut off.
        path: the file.
        answered: number of the last request that was followed.
    """

    time_s: float
    duration_s: float
    playing: bool
    speed: float
    started_ns: int
    cut: bool
    path: Path
    answered: int


def create_replay_files(directory: Path) -> None:
    """Make both slots; that they are there tells everybody that a recording is shown.

    Raises:
        MappedFileError: there is no room for them.
    """
    MappedSlot(directory / REPLAY_REQUEST_FILE, REPLAY_REQUEST, create=True).close()
    MappedSlot(directory / REPLAY_FILE, REPLAY, create=True).close()


class ReplayLink:
    """The side that watches. One process asks, from any thread.

    Args:
        directory: the run directory.

    Raises:
        MappedFileError: no recording is shown there.
    """

    def __init__(self, directory: Path) -> None:
        self._lock = threading.Lock()
        self._request = MappedSlot(directory / REPLAY_REQUEST_FILE, REPLAY_REQUEST, writable=True)
        self._status = MappedSlot(directory / REPLAY_FILE, REPLAY)

    @staticmethod
    def is_in(directory: Path) -> bool:
        """Whether the console of ``directory`` shows a recording."""
        return (directory / REPLAY_REQUEST_FILE).exists()

    def ask(
        self,
        time_s: float | None = None,
        playing: bool | None = None,
        speed: float | None = None,
    ) -> int:
        """Ask for another time, to play or pause, for another speed; None leaves it as it is.

        Returns:
            The number to wait for.
        """
        with self._lock:
            request = np.zeros(1, REPLAY_REQUEST)
            number = self._request.sequence + 1
            request["number"] = number
            request["time_s"] = np.nan if time_s is None else time_s
            request["playing"] = -1 if playing is None else int(playing)
            request["speed"] = np.nan if speed is None else speed
            request["stamp_ns"] = time.monotonic_ns()
            self._request.write(request)
            return number

    def status(self) -> ReplayStatus | None:
        """What is shown; None before the first picture."""
        return read_replay(self._status)

    def close(self) -> None:
        """Unmap both files."""
        self._request.close()
        self._status.close()


def read_replay(slot: MappedSlot) -> ReplayStatus | None:
    """What the replay said last, None when nothing yet."""
    try:
        said = slot.read()[0]
    except MappedReadError:
        return None
    return ReplayStatus(
        time_s=float(said["time_s"]),
        duration_s=float(said["duration_s"]),
        playing=bool(said["playing"]),
        speed=float(said["speed"]),
        started_ns=int(said["started_ns"]),
        cut=bool(said["cut"]),
        path=Path(os.fsdecode(bytes(said["path"]))),
        answered=int(said["answered"]),
    )
