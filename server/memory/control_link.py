"""The control side of the link. Nothing here waits, and an ordinary tick touches no file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.devices import DEVICES
from robot.records import INSTRUMENT, LEADER, RecordTypes, Request
from scenes.trocar_motion import Breathing
from server.control.leader_choice import NOBODY, LeaderChoice
from server.memory.link_records import (
    ALIVE,
    ALIVE_FILE,
    BOARD_CHANGE,
    BREATHING_CHANGE,
    DEVICES_FILE,
    EMERGENCY,
    EMERGENCY_FILE,
    HOLD_FILE,
    HOLD_SLOT,
    HOME,
    INJECT_FAULT,
    LEADER_KINDS,
    LEADER_SLOT,
    PATH_START,
    PATH_STOP,
    REBOOT_DEVICES,
    RECORD_RING_FILE,
    RECORD_SLOT_FILE,
    RELEASE_TORQUE,
    REQUEST_FILE,
    SETTINGS_CHANGE,
    STATUS,
    STATUS_FILE,
    SUPERVISION,
    SUPERVISION_FILE,
    TAKE_HOLD,
    TROCAR_CHANGE,
    TrocarSource,
    leader_file,
    path_file,
    request_message,
)
from server.memory.mapped import MappedReadError, MappedRing, MappedSlot

HOLD_TIMEOUT_NS = 1_000_000_000
"""A pressed hold-to-move counts as released when it was not repeated for so long."""

WEB_TIMEOUT_NS = 1_000_000_000
"""The operator counts as lost when the web server's event loop was silent for so long."""

LEADER_GONE_NS = 1_000_000_000
"""A leader silent for longer (and for ten of its own time-outs) no longer keeps others out."""

_REQUESTS = frozenset(int(request) for request in Request)
_DEVICE_REQUESTS = frozenset((HOME, RELEASE_TORQUE, TAKE_HOLD, REBOOT_DEVICES))


class PathStart(NamedTuple):
    """A path to play: the file of its spline, how many samples it has, its number, and whether the
    arm stands still meanwhile.
    """

    file: Path
    rows: int
    path_id: int
    lock_arm: bool = False


class TrocarChange(NamedTuple):
    """A trocar to register: how, and where (3,), base frame, m."""

    source: TrocarSource
    position: NDArray[np.float64]


class ControlLink:
    """What the web process wants, read once a tick by :meth:`poll`, and the way back.

    Requests that stand in the ring when it is opened are void: they were meant for another
    control process.

    Args:
        directory: the run directory.
        types: of the robot that is controlled.

    Attributes:
        request: the :class:`robot.records.Request` of this tick; NONE for none.
        request_sequence: number of the last request taken in.
        settings: (1,) settings, meaningful where ``settings_changed`` is True.
        settings_changed: whether new settings came in with this tick.
        path_start: a path to start in this tick, or None.
        path_stop: whether to stop the path in this tick.
        trocar_change: a trocar to register in this tick, or None.
        breathing: how the trocar shall breathe from now on, or None for no change.
        board: the board to put before the instrument, its place among the boards' names, or None.
        device_request: what the devices are asked for in this tick (HOME, RELEASE_TORQUE, TAKE_HOLD
            or REBOOT_DEVICES), or 0.
        fault: name of a fault to inject in this tick, "" to clear them, or None.
        hold: 1 while hold-to-move is pressed and freshly so, else 0.
        leader: (1,) LEADER, the active leader's newest sample with ``age_s`` set.

    Raises:
        MappedFileError: no console keeps its files there.
    """

    def __init__(self, directory: Path | str, types: RecordTypes = INSTRUMENT) -> None:
        self._directory = Path(directory)

        def slot(name: str, dtype: np.dtype[Any], writable: bool = False) -> MappedSlot:
            return MappedSlot(self._directory / name, dtype, writable=writable)

        self._record = slot(RECORD_SLOT_FILE, types.record, writable=True)
        self._ring = MappedRing(self._directory / RECORD_RING_FILE, types.record, writable=True)
        self._status = slot(STATUS_FILE, STATUS, writable=True)
        self._devices = slot(DEVICES_FILE, DEVICES, writable=True)
        self._requests = MappedRing(self._directory / REQUEST_FILE, request_message(types))
        self._emergency = slot(EMERGENCY_FILE, EMERGENCY)
        self._supervision = _Inbox(slot(SUPERVISION_FILE, SUPERVISION))
        self._hold = _Inbox(slot(HOLD_FILE, HOLD_SLOT))
        self._alive = _Inbox(slot(ALIVE_FILE, ALIVE))
        self._leaders = [
            _LeaderInbox(slot(leader_file(kind), LEADER_SLOT)) for kind in LEADER_KINDS
        ]
        self._choice = LeaderChoice(LEADER_KINDS)
        self._emergencies = self._emergency.sequence
        self._web_is_up, self._hold_is_down = True, False
        self._operator_lost = self._loss_is_new = False
        self.request = int(Request.NONE)
        self.request_sequence = self._requests.sequence
        self.settings = np.zeros(1, dtype=types.settings)
        self.settings_changed = False
        self.path_start: PathStart | None = None
        self.path_stop = False
        self.trocar_change: TrocarChange | None = None
        self.breathing: Breathing | None = None
        self.board: int | None = None
        self.device_request = 0
        self.fault: str | None = None
        self.hold = 0
        self.leader = np.zeros(1, dtype=LEADER)
        self.leader["wxyz"][0, 0] = 1.0
        self._leader_bytes = self.leader.view(np.uint8)
        self._leader_age, self._leader_clutch = self.leader["age_s"], self.leader["clutch"]

    def poll(self, now_ns: int) -> None:
        """Read what is new and set the attributes for the tick that follows."""
        self.request = int(Request.NONE)
        self.settings_changed = self.path_stop = False
        self.path_start = self.trocar_change = self.breathing = self.board = self.fault = None
        self.device_request = 0
        if self._emergency.sequence != self._emergencies:
            self._emergencies = self._emergency.sequence
            self._drop_requests()
            self.request = int(Request.EMERGENCY_STOP)
        elif self._requests.sequence != self.request_sequence:
            self._take_requests()
        self._poll_web(now_ns)
        self._poll_leaders(now_ns)

    def _drop_requests(self) -> None:
        """Void what was requested before an emergency stop; only settings, which move nothing."""
        messages, self.request_sequence, _ = self._requests.read_since(self.request_sequence)
        for message in messages:
            if message["kind"] == SETTINGS_CHANGE:
                self._take_settings(message)

    def _take_requests(self) -> None:
        """Take settings as they come, and at most one request that can start or end motion."""
        messages, following, lost = self._requests.read_since(self.request_sequence)
        if lost:
            # An unread request may have asked to stop.
            self.request_sequence, self.request = following, int(Request.PAUSE)
            return
        for message in messages:
            self.request_sequence += 1
            kind = int(message["kind"])
            if kind == SETTINGS_CHANGE:
                self._take_settings(message)
                continue
            if kind == PATH_START:
                path_id = int(message["path_id"])
                file = self._directory / path_file(path_id)
                locks = bool(message["path_locks_arm"])
                self.path_start = PathStart(file, int(message["path_rows"]), path_id, locks)
            elif kind == PATH_STOP:
                self.path_stop = True
            elif kind in (TROCAR_CHANGE, BREATHING_CHANGE, BOARD_CHANGE):
                self._take_change(kind, message)
            elif kind in _DEVICE_REQUESTS:
                self.device_request = kind
            elif kind == INJECT_FAULT:
                self.fault = message["fault"].decode()
            elif kind in _REQUESTS:
                self.request = kind
            return

    def _take_change(self, kind: int, message: np.void) -> None:
        if kind == TROCAR_CHANGE:
            source = TrocarSource(int(message["trocar_source"]))
            self.trocar_change = TrocarChange(source, message["trocar_position"].copy())
        elif kind == BREATHING_CHANGE:
            amplitude, period = message["breathing_amplitude"], message["breathing_period"]
            self.breathing = Breathing(float(amplitude), float(period))
        else:
            self.board = int(message["board"])

    def _take_settings(self, message: NDArray[Any]) -> None:
        self.settings[0] = message["settings"]
        self.settings_changed = True

    def _poll_web(self, now_ns: int) -> None:
        if self._supervision.update():
            self._web_is_up = bool(self._supervision.record["web_pid"][0])
        self._alive.update()
        if self._hold.update():
            self._hold_is_down = bool(self._hold.record["down"][0])
        spoke = self._alive.stamp_ns != 0
        lost = spoke and not (self._web_is_up and now_ns - self._alive.stamp_ns <= WEB_TIMEOUT_NS)
        self._loss_is_new = lost and (self._loss_is_new or not self._operator_lost)
        self._operator_lost = lost
        if self._loss_is_new and self.request in (Request.NONE, Request.ENABLE):
            self.request = int(Request.OPERATOR_LOST)
            self._loss_is_new = False
        pressed = self._hold_is_down and now_ns - self._hold.stamp_ns <= HOLD_TIMEOUT_NS
        self.hold = int(pressed and not lost)

    def _poll_leaders(self, now_ns: int) -> None:
        choice = self._choice
        before = choice.active
        for place, inbox in enumerate(self._leaders):
            if inbox.update():
                choice.update(place, inbox.closed, inbox.sequence)
            elif inbox.closed and now_ns - inbox.stamp_ns > inbox.patience_ns:
                inbox.closed = False
                choice.update(place, False, inbox.sequence)
        if choice.active == NOBODY:
            return
        inbox = self._leaders[choice.active]
        if inbox.changed or choice.active != before:
            self._leader_bytes[:] = inbox.leader_bytes
        if not choice.engaged:
            self._leader_clutch[0] = 0
        self._leader_age[0] = max(0, now_ns - inbox.stamp_ns) * 1e-9

    def release_leaders(self) -> None:
        """Let no leader lead until its clutch closes anew (a target: until a new one comes)."""
        self._choice.release()
        self._leader_clutch[0] = 0

    def publish(self, record: NDArray[Any]) -> None:
        """Publish a (1,) record into the ring and as the newest.

        In this order: a reader that has seen the newest finds it in the ring.
        """
        self._ring.push(record)
        self._record.write(record)

    def write_devices(self, devices: NDArray[Any]) -> None:
        """Publish the (1,) DEVICES; a few times a second."""
        self._devices.write(devices)

    def write_status(self, status: NDArray[Any]) -> None:
        """Publish the (1,) STATUS; for what changes rarely."""
        self._status.write(status)


class _Inbox:
    """A slot that is copied only when something new stands in it.

    Attributes:
        record: (1,) the newest that could be read.
        stamp_ns: its stamp; 0 before the first.
        changed: whether the last :meth:`update` found something new.
    """

    def __init__(self, slot: MappedSlot) -> None:
        self._slot = slot
        self._seen = 0
        self.record = np.zeros(1, dtype=slot.dtype)
        self._spare = np.zeros(1, dtype=slot.dtype)
        self.stamp_ns = 0
        self.changed = False

    def update(self) -> bool:
        """Take what is new; what cannot be read whole is left for the next tick."""
        self.changed = False
        sequence = self._slot.sequence
        if sequence == self._seen:
            return False
        try:
            self._slot.read(self._spare)
        except MappedReadError:
            return False
        self.record, self._spare = self._spare, self.record
        self._seen, self.changed = sequence, True
        self.stamp_ns = int(self.record["stamp_ns"][0])
        return True


class _LeaderInbox(_Inbox):
    """The newest sample of one leader, with what the choice among leaders needs of it."""

    def __init__(self, slot: MappedSlot) -> None:
        super().__init__(slot)
        self.closed = False
        self.sequence = 0
        self.patience_ns = float(LEADER_GONE_NS)

    def update(self) -> bool:
        """Take what is new; see the base class."""
        if not super().update():
            return False
        leader = self.record["leader"][0]
        self.closed, self.sequence = bool(leader["clutch"]), int(leader["sequence"])
        self.patience_ns = max(float(LEADER_GONE_NS), 1e10 * float(leader["timeout_s"]))
        return True

    @property
    def leader_bytes(self) -> NDArray[np.uint8]:
        """The LEADER record as bytes."""
        return self.record.view(np.uint8)[: LEADER.itemsize]
