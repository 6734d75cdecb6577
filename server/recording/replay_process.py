"""The replay process: stands where control would, and publishes recorded records as the newest.

Web and scene read them as they read those of a robot. There is no robot, no controller and no
plant in it, and it reads no requests but those for another time, pause and speed.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from server.memory.link_records import (
    RECORD_RING_FILE,
    RECORD_SLOT_FILE,
    STATUS,
    STATUS_FILE,
    Phase,
)
from server.memory.mapped import MappedReadError, MappedRing, MappedSlot
from server.memory.replay_link import (
    REPLAY,
    REPLAY_FILE,
    REPLAY_REQUEST,
    REPLAY_REQUEST_FILE,
    read_replay,
)
from server.recording.reader import Batch, Recording
from server.supervision.child_main import Stopped, child_parser, run_child

SLOWEST, FASTEST = 0.1, 10.0
"""Speeds of a replay, recorded time over real time."""

_PERIOD_S = 1.0 / 60.0
_CHUNKS_KEPT = 8


class Timeline:
    """The records of a recording by their time; the chunks last used stay decoded.

    Args:
        recording: open.

    Attributes:
        duration_s: of the whole.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._starts = np.array([chunk.start_ns for chunk in recording.chunks])
        self._decoded: OrderedDict[int, Batch] = OrderedDict()
        self.duration_s = recording.duration_s

    def at(self, time_s: float) -> NDArray[np.void]:
        """A copy (1,) of the newest record that is not younger than ``time_s`` since the start.

        Raises:
            RecordingUnreadable: that part is damaged.
        """
        time_ns = self._recording.start_ns + round(time_s * 1e9)
        place = max(0, int(np.searchsorted(self._starts, time_ns, side="right")) - 1)
        batch = self._batch(place)
        row = max(0, int(np.searchsorted(batch.time_ns, time_ns, side="right")) - 1)
        record: NDArray[np.void] = batch.records[row : row + 1].copy()
        return record

    def _batch(self, place: int) -> Batch:
        if place in self._decoded:
            self._decoded.move_to_end(place)
            return self._decoded[place]
        batch = self._recording.batch(self._recording.chunks[place])
        self._decoded[place] = batch
        if len(self._decoded) > _CHUNKS_KEPT:
            self._decoded.popitem(last=False)
        return batch


class Replay:
    """Shows a recording: publishes the record of the present time, over and over.

    Args:
        directory: the run directory.
        recording: open.
    """

    def __init__(self, directory: Path, recording: Recording) -> None:
        self._recording, self._timeline = recording, Timeline(recording)
        record = recording.types.record
        self._slot = MappedSlot(directory / RECORD_SLOT_FILE, record, writable=True)
        self._ring = MappedRing(directory / RECORD_RING_FILE, record, writable=True)
        self._control = MappedSlot(directory / STATUS_FILE, STATUS, writable=True)
        self._request = MappedSlot(directory / REPLAY_REQUEST_FILE, REPLAY_REQUEST)
        self._replay = MappedSlot(directory / REPLAY_FILE, REPLAY, writable=True)
        self._time_s, self._playing, self._speed = 0.0, False, 1.0
        before = read_replay(self._replay)
        if before is not None:
            self._time_s, self._speed = before.time_s, before.speed
        self._answered = 0 if before is None else before.answered
        self._stepped: float | None = None

    def announce(self) -> None:
        """Say what stands here instead of a control process."""
        said = np.zeros(1, STATUS)
        said["phase"], said["pid"] = int(Phase.RUNNING), os.getpid()
        said["plant"] = self._recording.metadata.get("plant", "").encode()
        said["board"] = self._recording.metadata.get("board", "").encode()
        said["realtime"], said["message"] = b"replay", b"shows a recording"
        said["rate_hz"], said["stamp_ns"] = 1.0 / _PERIOD_S, time.monotonic_ns()
        self._control.write(said)

    def step(self, now_s: float) -> None:
        """Go on to the present time and publish what was recorded then.

        Args:
            now_s: monotonic time.

        Raises:
            RecordingUnreadable: that part of the recording is damaged.
        """
        elapsed = 0.0 if self._stepped is None else now_s - self._stepped
        self._stepped = now_s
        if self._playing:
            self._time_s += elapsed * self._speed
        if self._request.sequence != self._answered:
            self._follow()
        end_s = self._timeline.duration_s
        if self._time_s >= end_s:
            self._time_s, self._playing = end_s, False
        record = self._timeline.at(self._time_s)
        record["header"]["stamp_ns"] = time.monotonic_ns()
        self._ring.push(record)
        self._slot.write(record)
        self._say()

    def _follow(self) -> None:
        try:
            request = self._request.read()[0]
        except MappedReadError:
            return
        self._answered = int(request["number"])
        time_s, speed = float(request["time_s"]), float(request["speed"])
        if request["playing"] >= 0:
            self._playing = bool(request["playing"])
            if self._playing and self._time_s >= self._timeline.duration_s:
                self._time_s = 0.0
        if math.isfinite(time_s):
            self._time_s = min(max(0.0, time_s), self._timeline.duration_s)
        if math.isfinite(speed):
            self._speed = min(max(SLOWEST, speed), FASTEST)

    def _say(self) -> None:
        said = np.zeros(1, REPLAY)
        said["answered"], said["stamp_ns"] = self._answered, time.monotonic_ns()
        said["time_s"], said["duration_s"] = self._time_s, self._timeline.duration_s
        said["playing"], said["speed"] = int(self._playing), self._speed
        said["started_ns"], said["cut"] = self._recording.start_ns, int(self._recording.cut)
        said["path"] = os.fsencode(self._recording.path)
        self._replay.write(said)


def _show(arguments: argparse.Namespace, stopped: Stopped) -> None:
    with Recording(arguments.file) as recording:
        replay = Replay(arguments.run_directory, recording)
        replay.announce()
        while not stopped():
            replay.step(time.monotonic())
            time.sleep(_PERIOD_S)


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m server.recording.replay_process --run-directory DIR --file FILE ...``."""
    parser = child_parser("replay")
    parser.add_argument("--file", required=True, type=Path)
    return run_child(parser, argv, _show)


if __name__ == "__main__":
    sys.exit(main())
