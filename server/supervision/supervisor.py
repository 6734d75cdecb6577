"""The supervisor: starts control, web, recorder and leader, watches them, and ends all in order.

Web, recorder and leader are started again whenever they end. Control, when it ends unexpectedly,
is marked as down and then started again; it wakes up DISABLED and nothing but a person enables it.
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
from robot.record_types import record_types_of
from server.audit.wall_clock import WallClock
from server.audit.writer import AuditLog
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
from server.memory.robot_selection import RobotSelection
from server.memory.run_directory import RunDirectory
from server.supervision.child_process import ChildProcess, describe_exit
from server.supervision.stop_order import StopOrder
from server.supervision.terminal import Terminal

_WATCH_S = 0.25
_CONTROL_PAUSE_S = 1.0
_WEB_PAUSE_S = 0.25
_RECORDER_PAUSE_S = 0.25
_LEADER_PAUSE_S = 0.25
_PATIENCE_S = 5.0
_SILENCE_S = 5.0
_STOP_S = 1.0
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
        audit: where starts, ends and stops are noted.
        terminal: Enter in it is an emergency stop.
    """

    def __init__(
        self,
        directory: RunDirectory,
        configuration: Configuration,
        listener: socket.socket,
        *,
        replay: Path | None = None,
        record: Path | None = None,
        audit: AuditLog | None = None,
        terminal: Terminal | None = None,
    ) -> None:
        self._audit = audit or AuditLog("supervisor", None)
        self._terminal = terminal or Terminal(None)
        self._wall_clock = WallClock()
        self._directory, self._configuration = directory, configuration
        self._selection = RobotSelection(directory.path)
        self._make_files()
        # The writing end is inherited by nobody, so it closes with this process.
        lifeline, self._lifeline_end = os.pipe()
        common = ["--run-directory", str(directory.path), "--lifeline-fd", str(lifeline)]
        self._recorder: ChildProcess | None = None
        self._leader: ChildProcess | None = None
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
            if configuration.stylus.source != "off":
                self._leader = ChildProcess(
                    "leader", "server.leaders.process", common, [lifeline], _LEADER_PAUSE_S
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

    def _make_files(self) -> None:
        """Make every mapped file, in the form that the configuration's robot has."""
        path, configuration = self._directory.path, self._configuration
        types, seconds = record_types_of(configuration), configuration.control.record_ring_seconds
        create_mapped_files(path, configuration.rate_hz, seconds, types)
        self._supervision = MappedSlot(path / SUPERVISION_FILE, SUPERVISION, writable=True)
        self._status = MappedSlot(path / STATUS_FILE, STATUS)
        self._record = MappedSlot(path / RECORD_SLOT_FILE, types.record)
        self._stop_order = StopOrder(self._record)

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
            self._start()
            while not self._ending:
                self._wait(wake)
                self._watch_control()
                self._watch_web()
                self._watch_beside(self._recorder, "the recorder")
                self._watch_beside(self._leader, "the stylus' process")
                self._watch_wall_clock()
                self._watch_selection()
        finally:
            self._end()
            os.close(self._lifeline_end)
        return self._exit_status

    def _start(self) -> None:
        for child in (self._web, self._control, self._recorder, self._leader):
            if child is not None:
                child.start()
                self._note_start(child)
        self._mark(ControlState.STARTING)

    def _watch_selection(self) -> None:
        """Start everything anew with another robot, where one was selected.

        Records of another robot have another form: no process of before could read them.
        """
        robot = self._selection.take()
        before = self._configuration.robot
        if robot is None or robot == before:
            return
        say(f"the robot is changed from {before} to {robot}; everything starts anew, disabled")
        self._audit.note("robot_selected", f"{robot} in place of {before}", robot=robot)
        self._end()
        self._configuration = self._configuration.model_copy(update={"robot": robot})
        self._directory.change_robot(self._configuration)
        self._make_files()
        self._message, self._phase, self._has_run = "", Phase.STARTING, False
        self._ticks = 0
        self._start()

    def _note_start(self, child: ChildProcess) -> None:
        again = f" again ({child.restarts})" if child.restarts else ""
        self._audit.note(
            "process_started", f"{child.title} was started{again}",
            process=child.title, child=child.pid, restarts=child.restarts,
        )  # fmt: skip

    def _note_end(self, child: ChildProcess, cause: str) -> None:
        words = f"{child.title} ended unexpectedly ({cause})"
        self._audit.note("process_ended", words, process=child.title, cause=cause)

    def _watch_wall_clock(self) -> None:
        jump_s = self._wall_clock.jump_s()
        if jump_s is not None:
            words = f"the wall clock moved by {jump_s:+.3f} s; nothing depends on it"
            self._audit.note("clock_jumped", words, jump_s=round(jump_s, 6))

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

    def _wait(self, wake: socket.socket) -> None:
        typed = self._terminal.descriptors()
        ready, _, _ = select.select([wake.fileno(), *typed], [], [], _WATCH_S)
        if any(one in ready for one in typed) and self._terminal.pressed():
            self._stop_from_terminal()
        with contextlib.suppress(BlockingIOError):
            wake.recv(4096)

    def _stop_from_terminal(self) -> None:
        if self._recorder is None:
            say("this is a replay: nothing moves")
            return
        sent = self._stop_order.send(self._control.pid)
        took_ms = self._stop_order.wait(_STOP_S) if sent else None
        if took_ms is None:
            words = "emergency stop from the terminal: control does not confirm it"
            say(f"{words}; use the stop on the machine")
        else:
            words = f"emergency stop from the terminal: the robot holds after {took_ms:.1f} ms"
            say(words)
        self._audit.note("emergency_stop", words, by="terminal", took_ms=took_ms)

    def _watch_control(self) -> None:
        status = self._control.ended()
        if status is not None:
            self._control_ended(status)
        elif self._control.restart_if_due():
            self._phase = Phase.STARTING
            self._note_start(self._control)
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
        self._note_end(self._control, cause)
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
            words = f"control has not ticked for {_SILENCE_S:g} s and is ended by force"
            say(words)
            self._audit.note("process_hung", words, process="control")
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
            self._note_end(self._web, describe_exit(status))
            self._mark_again()
        elif self._web.restart_if_due():
            self._note_start(self._web)
            self._mark_again()

    def _watch_beside(self, process: ChildProcess | None, name: str) -> None:
        """Start again what nobody else waits for."""
        if process is None:
            return
        status = process.ended()
        if status is not None and not self._ending:
            say(f"{name} ended unexpectedly ({describe_exit(status)}); it starts again")
            self._note_end(process, describe_exit(status))
        elif process.restart_if_due():
            self._note_start(process)

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
        for process, name in (
            (self._leader, "the stylus' process"),
            (self._recorder, "the recorder"),
        ):
            if process is not None and not process.finish(_PATIENCE_S):
                say(f"{name} did not end within {_PATIENCE_S:g} s and was ended by force")
        if not self._web.finish(_PATIENCE_S):
            say(f"web did not end within {_PATIENCE_S:g} s and was ended by force")
