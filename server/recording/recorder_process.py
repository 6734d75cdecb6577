"""The recorder process: writes down every record of the ring while a recording is wanted, and
every change of the safety state always.

It only reads what the control process publishes. When it falls behind further than the ring
reaches, or cannot write, control does not notice; the recording says what is missing.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from robot.errors import KeyholeError
from robot.record_types import record_types_of
from server.audit.transitions import TransitionWatch
from server.audit.writer import AuditLog
from server.memory.link_records import RECORD_RING_FILE, STATUS, STATUS_FILE
from server.memory.mapped import MappedReadError, MappedRing, MappedSlot
from server.memory.recording_link import (
    RECORDING,
    RECORDING_FILE,
    RECORDING_REQUEST,
    RECORDING_REQUEST_FILE,
    RecordingState,
    RecordingStatus,
    read_status,
)
from server.memory.run_directory import RunDirectory
from server.recording.errors import RecordingError, RecordingNotWritten
from server.recording.folder import following
from server.recording.reader import Recording
from server.recording.writer import CHUNK_S, RecordingWriter
from server.supervision.child_main import Stopped, child_parser, run_child

_PERIOD_S = 0.05
_SAY_S = 0.2
_AT_ONCE = 2000
"""Records taken from the ring in one go: a recorder that has fallen behind still answers."""


class Recorder:
    """Follows the requests, and the ring while it records.

    Args:
        directory: of a console whose mapped files exist.
    """

    def __init__(self, directory: RunDirectory) -> None:
        path = directory.path
        self._directory = directory
        self._types = record_types_of(directory.configuration())
        self._ring = MappedRing(path / RECORD_RING_FILE, self._types.record)
        self._control = MappedSlot(path / STATUS_FILE, STATUS)
        self._request = MappedSlot(path / RECORDING_REQUEST_FILE, RECORDING_REQUEST)
        self._status = MappedSlot(path / RECORDING_FILE, RECORDING, writable=True)
        self._writer: RecordingWriter | None = None
        self._sequence = 0
        self._flushed = self._said = -1.0
        self._state = RecordingState.IDLE
        self._message = ""
        self._written: Path | None = None
        self._awaited: Path | None = None
        self._counts, self._duration_ns = (0, 0, 0, 0, 0), 0
        before = read_status(self._status)
        self._answered = before.answered
        self._go_on(before)

    def _go_on(self, before: RecordingStatus) -> None:
        """Take up what a recorder before this one was in the middle of."""
        if before.state == RecordingState.IDLE or before.path is None:
            return
        self._written, self._message = before.path, before.message
        if before.state == RecordingState.FAILED:
            self._state = RecordingState.FAILED
            return
        path = following(before.path)
        self._start(path, self._after(before))
        if self._state == RecordingState.RECORDING and path != before.path:
            self._message = f"the recorder was started again; the part before is {before.path.name}"

    def _after(self, before: RecordingStatus) -> int:
        """Number of the first record that is not in the file of the recorder before.

        It may have written a chunk more than it has told of.
        """
        assert before.path is not None
        try:
            with Recording(before.path) as recording:
                last = int(recording.batch(recording.chunks[-1]).sequence[-1])
        except RecordingError:
            return before.next_sequence
        ahead = (last + 1 - before.next_sequence) & 0xFFFFFFFF
        return before.next_sequence + (ahead if ahead <= self._ring.capacity else 0)

    def step(self) -> None:
        """Follow what is asked, and write what has come; called some twenty times a second."""
        if self._request.sequence != self._answered:
            self._follow()
        if self._awaited is not None and self._ring.sequence > 0:
            self._open(self._awaited)
        if self._writer is not None:
            self._guarded(self._take)
        if time.monotonic() - self._said > _SAY_S:
            self._say()

    def _follow(self) -> None:
        try:
            request = self._request.read()[0]
        except MappedReadError:
            return
        self._finish()
        self._answered = int(request["number"])
        self._state, self._message = RecordingState.IDLE, ""
        if request["start"]:
            self._start(Path(os.fsdecode(bytes(request["path"]))), self._ring.sequence)
        self._say()

    def _start(self, path: Path, sequence: int) -> None:
        self._written, self._sequence = path, sequence
        self._counts, self._duration_ns = (0, 0, 0, 0, sequence), 0
        self._state, self._awaited = RecordingState.RECORDING, path
        # Before its first tick control may still calibrate, and its calibration goes into the file.
        if self._ring.sequence > 0:
            self._open(path)

    def _open(self, path: Path) -> None:
        self._awaited = None
        try:
            self._writer = RecordingWriter(
                path,
                self._directory.configuration(),
                self._directory.calibration(),
                clock="host",
                plant=self._told("plant"),
                board=self._told("board"),
            )
        except KeyholeError as error:
            self._fail(error)
            return
        self._flushed = time.monotonic()

    def _told(self, name: str) -> str:
        """What control says of itself; empty while it has not spoken."""
        with contextlib.suppress(MappedReadError):
            return str(self._control.read()[0][name].decode(errors="replace"))
        return ""

    def _guarded(self, act: Callable[[], None]) -> None:
        """Do what may fail by the disk; a failure ends the recording and nothing else."""
        try:
            act()
        except RecordingNotWritten as error:
            self._fail(error)

    def _take(self) -> None:
        writer = self._writer
        assert writer is not None
        while True:
            records, following_one, _ = self._ring.read_since(self._sequence, _AT_ONCE)
            if len(records) == 0:
                break
            # Records that were lost show as a jump of the number.
            writer.append(records, following_one - len(records))
            self._sequence = following_one
        now = time.monotonic()
        if now - self._flushed >= CHUNK_S:
            self._flushed = now
            writer.flush()
            self._count(writer)

    def _count(self, writer: RecordingWriter) -> None:
        """Remember what stands in the file, all of it flushed."""
        self._counts = (writer.size, writer.ticks, writer.gaps, writer.lost, self._sequence)
        self._duration_ns = round(writer.duration_s * 1e9)

    def _fail(self, error: KeyholeError) -> None:
        self._state, self._message = RecordingState.FAILED, str(error)
        print(f"keyhole recorder: {error}", file=sys.stderr, flush=True)
        if self._writer is not None:
            self._writer.abandon()
            self._writer = None

    def _finish(self) -> None:
        """End the recording, if there is one, with all that control has published."""
        if self._awaited is not None and self._ring.sequence > 0:
            self._open(self._awaited)
        self._awaited = None
        if self._writer is None:
            if self._state == RecordingState.RECORDING:
                self._state = RecordingState.IDLE
            return
        self._guarded(self._take)
        if self._writer is not None:
            self._guarded(self._writer.close)
        if self._writer is not None:
            self._count(self._writer)
            self._writer = None
            self._state = RecordingState.IDLE

    def _say(self) -> None:
        self._said = time.monotonic()
        said = np.zeros(1, RECORDING)
        said["state"], said["answered"] = int(self._state), self._answered
        said["pid"], said["stamp_ns"] = os.getpid(), time.monotonic_ns()
        size, ticks, gaps, lost, following_one = self._counts
        said["size"], said["ticks"], said["gaps"], said["lost"] = size, ticks, gaps, lost
        said["next_sequence"], said["duration_ns"] = following_one, self._duration_ns
        said["path"] = os.fsencode(self._written) if self._written else b""
        said["message"] = self._message.encode()[:512]
        self._status.write(said)

    def close(self) -> None:
        """End the recording and say so."""
        self._finish()
        self._say()


def _record(arguments: argparse.Namespace, stopped: Stopped) -> None:
    # A file that may not grow further must be an error, not the end of the process.
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    directory = RunDirectory(arguments.run_directory)
    recorder = Recorder(directory)
    audit = AuditLog.of_console("recorder", directory.path)
    transitions = TransitionWatch(directory.path, audit, record_types_of(directory.configuration()))
    while not stopped():
        recorder.step()
        transitions.step()
        time.sleep(_PERIOD_S)
    recorder.close()
    transitions.step()
    audit.close()


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m server.recording.recorder_process --run-directory DIR [--lifeline-fd N]``."""
    return run_child(child_parser("recorder"), argv, _record)


if __name__ == "__main__":
    sys.exit(main())
