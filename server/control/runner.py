"""The loop over ticks: deadlines, overruns, and the way of requests into the control loop."""

from __future__ import annotations

import contextlib
import gc
import time
from collections.abc import Callable

import numpy as np

from hardware.devices import DEVICES
from robot.records import Request, Safety
from robot.safety import Event, apply_event
from scenes.boards.board import BOARD_NAMES
from server.control.lifeline import Lifeline
from server.control.loop import ControlLoop
from server.control.mapped_path import MappedPath
from server.memory.control_link import ControlLink, PathStart
from server.memory.link_records import HOME, REBOOT_DEVICES, RELEASE_TORQUE, TAKE_HOLD

_LIFELINE_EVERY_TICKS = 50
_COLLECT_EVERY_NS = 10_000_000_000
_COLLECT_SLACK_NS = 1_000_000
_KEEPS_LEADING = (Request.NONE, Request.ENABLE)
"""After any other request nothing that led before may go on by itself when motion is allowed."""


class ControlRunner:
    """Steps a control loop at a fixed rate against absolute deadlines.

    A tick that comes a period late or more skips the deadlines it missed and counts them as
    overruns; the grid of deadlines never shifts, so lateness does not add up.

    Args:
        loop: what is stepped.
        link: where requests come from and records go.
        lifeline: cut when the supervisor is gone.
        rate_hz: how often it is stepped.
        changed: called after the board, the trocar or its breathing has changed.
    """

    def __init__(
        self,
        loop: ControlLoop,
        link: ControlLink,
        lifeline: Lifeline,
        rate_hz: float,
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        self._loop, self._link, self._lifeline = loop, link, lifeline
        self._changed = changed
        self._period_ns = round(1e9 / rate_hz)
        self._excused = self._emergency = False
        # The link writes the active leader's sample right where the loop reads it.
        loop.leader = link.leader
        self._header = loop.record["header"][0]
        self._stopping = False
        self._until_lifeline = _LIFELINE_EVERY_TICKS
        self._collected_ns = 0
        self._devices = np.zeros(1, DEVICES)

    def stop(self) -> None:
        """Ask the loop to end after the tick it is in; may be called from a signal handler."""
        self._stopping = True

    def emergency_stop(self) -> None:
        """Stop all motion with the next tick; called from a signal handler, when all else hangs."""
        self._emergency = True

    def run(self) -> None:
        """Step until :meth:`stop` is called or the supervisor is gone, then let the plant hold."""
        period_ns, header, loop = self._period_ns, self._header, self._loop
        overruns = 0
        deadline_ns = time.monotonic_ns() + period_ns
        while not self._stopping:
            wait_ns = deadline_ns - time.monotonic_ns()
            if wait_ns > 0:
                time.sleep(wait_ns * 1e-9)
            now_ns = time.monotonic_ns()
            lateness_ns = now_ns - deadline_ns
            missed = lateness_ns // period_ns
            if missed > 0:
                overruns += 0 if self._excused else missed
                deadline_ns += missed * period_ns
            loop.late_s = 0.0 if self._excused else lateness_ns * 1e-9
            self._excused = False
            header["lateness_ns"], header["overruns"] = lateness_ns, overruns
            self._tick(now_ns)
            deadline_ns += period_ns
            self._between_ticks(deadline_ns)
        self._loop.plant.hold()

    def _tick(self, now_ns: int) -> None:
        link, loop = self._link, self._loop
        link.poll(now_ns)
        self._take_in()
        loop.step()
        self._header["request_sequence"] = link.request_sequence
        self._header["stamp_ns"] = time.monotonic_ns()
        link.publish(loop.record)

    def _take_in(self) -> None:
        """Hand over what this tick's poll found."""
        link, loop = self._link, self._loop
        loop.request, loop.hold = link.request, link.hold
        if self._emergency:
            self._emergency = False
            loop.request = Request.EMERGENCY_STOP
        if link.settings_changed:
            loop.settings[:] = link.settings
        released = loop.request not in _KEEPS_LEADING
        if released:
            link.release_leaders()
        if released or link.path_stop:
            loop.stop_path()
        if link.path_start is not None:
            self._start_path(link.path_start)
        if link.trocar_change is not None and loop.safety in (Safety.DISABLED, Safety.PAUSED):
            loop.register_trocar(*link.trocar_change)
            self._changed()
        if link.breathing is not None:
            loop.breathe(link.breathing)
            self._changed()
        if link.board is not None and loop.safety == Safety.DISABLED:
            self._change_board(BOARD_NAMES[link.board])
        if link.device_request:
            self._ask_devices(link.device_request)
        if link.fault is not None:
            self._loop.inject(link.fault)

    def _ask_devices(self, kind: int) -> None:
        """What the devices are asked for is theirs to do, beside the loop; nothing here waits."""
        loop, plant = self._loop, self._loop.plant
        if kind == RELEASE_TORQUE:
            if loop.safety in (Safety.ENABLED, Safety.PAUSED):
                loop.request = Request.DISABLE
            plant.release()
        elif kind == HOME and loop.safety == Safety.DISABLED:
            plant.home()
        elif loop.safety == Safety.ENABLED:
            return
        elif kind == TAKE_HOLD:
            plant.take_hold()
        elif kind == REBOOT_DEVICES:
            plant.reboot()

    def _start_path(self, wanted: PathStart) -> None:
        """Play a path; whoever asked sees by the record's ``path_id`` that it plays."""
        with contextlib.suppress(OSError, ValueError):
            path = MappedPath(wanted.file, wanted.rows, f"path {wanted.path_id}")
            self._loop.start_path(path, wanted.path_id, wanted.lock_arm)

    def _change_board(self, name: str) -> None:
        """Put another board before the robot; the ticks that are missed meanwhile are no overruns,
        for a disabled robot waits for none.
        """
        self._loop.change_board(name)
        self._excused = True
        self._changed()

    def _between_ticks(self, deadline_ns: int) -> None:
        """What may be done rarely, in the time left until the next deadline."""
        self._until_lifeline -= 1
        if self._until_lifeline > 0:
            return
        self._until_lifeline = _LIFELINE_EVERY_TICKS
        self._loop.plant.fill_devices(self._devices)
        self._link.write_devices(self._devices)
        if self._lifeline.is_cut():
            self._stopping = True
        now_ns = time.monotonic_ns()
        late = now_ns - self._collected_ns > _COLLECT_EVERY_NS
        if late and deadline_ns - now_ns > _COLLECT_SLACK_NS:
            self._collected_ns = now_ns
            gc.collect(0)

    def fail(self) -> None:
        """After an exception in the loop: the plant holds, and a last record shows the FAULT."""
        try:
            self._loop.plant.hold()
        finally:
            record = self._loop.record
            state = np.zeros(1, dtype=record["outcome"].dtype)
            state[:] = record["outcome"]
            apply_event(state, int(Event.CONTROL_FAILED))
            state["command"]["moving"] = 0
            record["outcome"] = state
            record["header"]["tick"] += 1
            record["header"]["stamp_ns"] = time.monotonic_ns()
            self._link.publish(record)
