"""The supervisor: starts control, web and recorder at once, watches them, and ends all in order.

Web and recorder are started again whenever they end. Control, when it ends unexpectedly, is marked
as down and then started again; it wakes up DISABLED and nothing but a person enables it.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import sys
import time
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import RECORD
from server.memory.link_records import (
    RECORD_SLOT_FILE,
    STATUS,
    STATUS_FILE,
    SUPERVISION,
    SUPERVISION_FILE,
    ControlState,
    Phase,
    create_mapped_files,
)
from server.memory.mapped import MappedReadError, MappedSlot
from server.memory.recording_link import RecordingLink
from server.memory.replay_link import create_replay_files
from server.memory.run_directory import RunDirectory
from server.supervision.child_process import ChildProcess, describe_exit

_WATCH_S = 0.25
_CONTROL_PAUSE_S = 1.0
_WEB_PAUSE_S = 0.25
_RECORDER_PAUSE_S = 0.25
_PATIENCE_S = 5.0
_SILENCE_S = 5.0
_CANNOT_START = 2


def say(message: str) -> None:
    """Tell the person at the terminal one line."""
    print(f"keyhole: {' '.join(message.split())}", file=sys.stderr, flush=True)


class Supervisor:
    """Runs one console from its start to its end.

    Args:
        directory: the run directory, taken.
        configuration: the validated configuration, already stored in the directory.
        listener: the public port.
        replay: a recording that is shown in place of a robot; there is then neither control nor
            recorder.
        record: a file to record into from the start.
    """

    def __init__(
        self,
        directory: RunDirectory,
        configuration: Configuration,
        listener: socket.socket,
        *,
        replay: Path | None = None,
        record: Path | None = None,
    ) -> None:
        control = configuration.control
        create_mapped_files(directory.path, control.rate_hz, control.record_ring_seconds)
        self._supervision = MappedSlot(
            directory.path / SUPERVISION_FILE, SUPERVISION, writable=True
        )
        self._status = MappedSlot(directory.path / STATUS_FILE, STATUS)
        self._record = MappedSlot(directory.path / RECORD_SLOT_FILE, RECORD)
        # The writing end is inherited by nobody, so it closes with this process.
        lifeline, self._lifeline_end = os.pipe()
        common = ["--run-directory", str(directory.path), "--lifeline-fd", str(lifeline)]
        self._recorder: ChildProcess | None = None
        if replay is None:
            self._control = ChildProcess(
                "control", "server.control.process", common, [lifeline], _CONTROL_PAUSE_S
            )
            self._recorder = ChildProcess(
                "recorder",
                "server.recording.recorder_process",
                common,
                [lifeline],
                _RECORDER_PAUSE_S,
            )
            self._ask_for(directory.path, record)
        else:
            create_replay_files(directory.path)
            shown = [*common, "--file", str(replay)]
            self._control = ChildProcess(
                "replay", "server.recording.replay_process", shown, [lifeline], _CONTROL_PAUSE_S
            )
        self._web = ChildProcess(
            "web",
            "server.web.process",
            [*common, "--listen-fd", str(listener.fileno())],
            [lifeline, listener.fileno()],
            _WEB_PAUSE_S,
        )
        self._message = ""
        self._phase = Phase.STARTING
        self._has_run = False
        self._ticks, self._ticked = 0, 0.0
        self._ending = False
        self._exit_status = 0

    @staticmethod
    def _ask_for(directory: Path, record: Path | None) -> None:
        """Have the recorder begin with its first breath; later requests come from web."""
        if record is not None:
            link = RecordingLink(directory)
            link.start(record)
            link.close()

    def run(self) -> int:
        """Start everything, watch it until SIGINT, SIGTERM or SIGHUP, end it in order.

        Returns:
            0, or 2 when the control process refused to start.
        """
        wake = self._catch_signals()
        try:
            self._web.start()
            self._control.start()
            if self._recorder is not None:
                self._recorder.start()
            self._mark(ControlState.STARTING)
            while not self._ending:
                self._wait(wake)
                self._watch_control()
                self._watch_web()
                self._watch_recorder()
        finally:
            self._end()
        return self._exit_status

    def _catch_signals(self) -> socket.socket:
        reading, writing = socket.socketpair()
        reading.setblocking(False)
        writing.setblocking(False)
        signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
        # Kept alive by this attribute: the wake-up descriptor does not own the socket.
        self._wake_end = writing
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_end)
        # Without a handler the end of a child would not wake the supervisor.
        signal.signal(signal.SIGCHLD, lambda *_: None)
        return reading

    def _on_end(self, _number: int, _frame: FrameType | None) -> None:
        self._ending = True

    @staticmethod
    def _wait(wake: socket.socket) -> None:
        select.select([wake], [], [], _WATCH_S)
        with contextlib.suppress(BlockingIOError):
            wake.recv(4096)

    def _watch_control(self) -> None:
        status = self._control.ended()
        if status is not None:
            self._control_ended(status)
        elif self._control.restart_if_due():
            self._phase = Phase.STARTING
            self._mark(ControlState.STARTING)
        elif self._control.pid:
            self._watch_phase()

    def _control_ended(self, status: int) -> None:
        if self._ending:
            return
        if status == _CANNOT_START and not self._has_run:
            # It has said why on its own line.
            self._exit_status, self._ending = _CANNOT_START, True
            return
        said = self._control_status()
        cause = describe_exit(status)
        if said is not None and said["phase"][0] == Phase.FAILED:
            cause = said["message"][0].decode(errors="replace")
        self._message = f"control ended unexpectedly ({cause}); it starts again, disabled"
        say(self._message)
        self._mark(ControlState.DOWN)

    def _watch_phase(self) -> None:
        said = self._control_status()
        phase = Phase.STARTING if said is None else Phase(int(said["phase"][0]))
        if said is not None and phase == Phase.RUNNING and self._phase != Phase.RUNNING:
            self._has_run = True
            self._ticked = time.monotonic()
            rate, words = float(said["rate_hz"][0]), said["realtime"][0].decode()
            if self._recorder is None:
                say("shows a recording; no robot is connected")
            else:
                say(f"control runs at {rate:g} Hz; real-time scheduling: {words}")
            if self._control.restarts:
                self._message = f"{self._message}; control is back, disabled".lstrip("; ")
            self._mark(ControlState.RUNNING)
        self._phase = phase
        if phase == Phase.RUNNING:
            self._watch_ticks()

    def _watch_ticks(self) -> None:
        now, ticks = time.monotonic(), self._record.sequence
        if ticks != self._ticks:
            self._ticks, self._ticked = ticks, now
        elif now - self._ticked > _SILENCE_S:
            say(f"control has not ticked for {_SILENCE_S:g} s and is ended by force")
            self._ticked = now
            self._control.kill()

    def _control_status(self) -> NDArray[Any] | None:
        """What the present control process said last, or None before its first word."""
        try:
            said = self._status.read()
        except MappedReadError:
            return None
        return said if said["stamp_ns"][0] > self._control.started_ns else None

    def _watch_web(self) -> None:
        status = self._web.ended()
        if status is not None and not self._ending:
            say(f"web ended unexpectedly ({describe_exit(status)}); it starts again")
            self._mark_again()
        elif self._web.restart_if_due():
            self._mark_again()

    def _watch_recorder(self) -> None:
        if self._recorder is None:
            return
        status = self._recorder.ended()
        if status is not None and not self._ending:
            say(f"the recorder ended unexpectedly ({describe_exit(status)}); it starts again")
        else:
            self._recorder.restart_if_due()

    def _mark_again(self) -> None:
        self._mark(self._control_state)

    def _mark(self, control: ControlState) -> None:
        """Let everybody know which processes are up."""
        self._control_state = control
        record = np.zeros(1, dtype=SUPERVISION)
        record["control"], record["control_pid"] = int(control), self._control.pid
        record["web_pid"] = self._web.pid
        record["control_restarts"] = self._control.restarts
        record["web_restarts"] = self._web.restarts
        record["message"] = self._message.encode()
        record["stamp_ns"] = time.monotonic_ns()
        self._supervision.write(record)

    def _end(self) -> None:
        """End control first, so that the robot holds, then the recorder, then web."""
        if not self._control.finish(_PATIENCE_S):
            say(f"control did not end within {_PATIENCE_S:g} s and was ended by force")
        if self._recorder is not None and not self._recorder.finish(_PATIENCE_S):
            say(f"the recorder did not end within {_PATIENCE_S:g} s and was ended by force")
        if not self._web.finish(_PATIENCE_S):
            say(f"web did not end within {_PATIENCE_S:g} s and was ended by force")
        os.close(self._lifeline_end)
