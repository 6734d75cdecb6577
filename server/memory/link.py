"""The link between the web process and the control process: mapped files, no queue that blocks.

Requests pass through a ring in order; the emergency stop has a file of its own, so that it cannot
stand behind anything; leaders and hold-to-move are newest-value slots. The control side never
waits for the web side, and takes the web side's silence as the loss of the operator.
"""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.devices import DEVICES
from robot.errors import InvalidPose
from robot.records import INSTRUMENT, DriveMode, LeaderKind, RecordTypes, Request
from scenes.trocar_motion import Breathing
from server.memory.leader_slot import SMALLEST_QUATERNION, LeaderSlot
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
    PATH_COLUMNS,
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
    WEB_LEADER_KINDS,
    ControlState,
    Phase,
    TrocarSource,
    path_file,
    request_message,
)
from server.memory.mapped import MappedReadError, MappedRing, MappedSlot

_PATHS_FILE = "paths.json"


class WebLink:
    """The web side. One per web process; its methods may be called from any thread.

    Opening it opens every clutch and releases hold-to-move: whoever drove before is gone.

    Args:
        directory: the run directory.
        types: of the robot that control drives.

    Attributes:
        directory, types: the same.

    Raises:
        MappedFileError: no console keeps its files there.
    """

    def __init__(self, directory: Path | str, types: RecordTypes = INSTRUMENT) -> None:
        self.directory = self._directory = Path(directory)
        self.types = types
        self._request_type = request_message(types)
        self._lock = threading.Lock()
        self._emergency_lock = threading.Lock()
        self._record = MappedSlot(self._directory / RECORD_SLOT_FILE, types.record)
        self._status = MappedSlot(self._directory / STATUS_FILE, STATUS)
        self._supervision = MappedSlot(self._directory / SUPERVISION_FILE, SUPERVISION)
        self._devices = MappedSlot(self._directory / DEVICES_FILE, DEVICES)
        self._requests = MappedRing(
            self._directory / REQUEST_FILE, self._request_type, writable=True
        )
        self._emergency = MappedSlot(self._directory / EMERGENCY_FILE, EMERGENCY, writable=True)
        self._hold = MappedSlot(self._directory / HOLD_FILE, HOLD_SLOT, writable=True)
        self._alive = MappedSlot(self._directory / ALIVE_FILE, ALIVE, writable=True)
        self._leaders = {kind: LeaderSlot(self._directory, kind) for kind in WEB_LEADER_KINDS}
        self._paths = self._known_paths()
        self.hold(False)

    def request(self, kind: int) -> int:
        """Send a :class:`robot.records.Request`; returns the number to wait for.

        It was taken in when ``header.request_sequence`` of a record is at least that number.
        """
        return self._send(kind)

    def settings(self, settings: NDArray[Any]) -> int:
        """Send the operator's choices, (1,) or () settings; returns the number to wait for."""
        return self._send(SETTINGS_CHANGE, settings=settings)

    def start_path(self, samples: NDArray[np.float64], name: str, lock_arm: bool = False) -> int:
        """Send a path and start it; returns the number to wait for.

        Takes about 1 ms for every 1000 samples: an event loop should leave it to a thread.

        Args:
            samples: (n >= 2, 8), columns time in s, increasing from 0, position in m, quaternion
                w, x, y, z.
            name: shown while it plays; :meth:`status` tells it by the record's ``path_id``.
            lock_arm: whether the arm stands still meanwhile.

        Raises:
            InvalidPose: the samples make no path; nothing is sent.
        """
        rows = np.ascontiguousarray(samples, dtype=np.float64)
        _check_path(rows)
        from server.control.mapped_path import MappedPath

        content = MappedPath.file_bytes(rows)
        with self._lock:
            path_id = max(self._paths, default=0) + 1
            self._write_file(path_file(path_id), content)
            self._paths[path_id] = name
            self._write_file(_PATHS_FILE, json.dumps(self._paths).encode())
            with contextlib.suppress(OSError):
                # The one before may still be on its way to the control process.
                (self._directory / path_file(path_id - 2)).unlink()
            return self._send_locked(
                PATH_START, path_id=path_id, path_rows=len(rows), path_locks_arm=int(lock_arm)
            )

    def stop_path(self) -> int:
        """Stop the path that plays, if any; returns the number to wait for."""
        return self._send(PATH_STOP)

    def register_trocar(self, source: TrocarSource, position: NDArray[np.float64]) -> int:
        """Say where the trocar is, (3,), base frame, m; returns the number to wait for.

        Control takes it only while the robot is DISABLED or PAUSED; :meth:`status` tells.
        """
        return self._send(TROCAR_CHANGE, trocar_source=int(source), trocar_position=position)

    def breathe(self, breathing: Breathing) -> int:
        """Say how the trocar breathes; returns the number to wait for."""
        return self._send(
            BREATHING_CHANGE,
            breathing_amplitude=breathing.amplitude_m,
            breathing_period=breathing.period_s,
        )

    def change_board(self, board: int) -> int:
        """Ask for the board at that place among ``scenes.boards.board.BOARD_NAMES``; returns the
        number to wait for. Control takes it only while the robot is DISABLED.
        """
        return self._send(BOARD_CHANGE, board=board)

    def home(self) -> int:
        """Ask the instrument module to find its zero; only taken while the robot is DISABLED."""
        return self._send(HOME)

    def release_torque(self) -> int:
        """Ask every device to let go; a robot that is enabled or paused is disabled by it."""
        return self._send(RELEASE_TORQUE)

    def take_hold(self) -> int:
        """Ask every device to put torque on where it stands; not taken while ENABLED."""
        return self._send(TAKE_HOLD)

    def reboot_devices(self) -> int:
        """Ask devices that took themselves out of service to start anew; not while ENABLED."""
        return self._send(REBOOT_DEVICES)

    def inject_fault(self, name: str) -> int:
        """Put a fault of ``hardware.faulty_plant.FAULTS`` into a simulated robot; "" clears all."""
        return self._send(INJECT_FAULT, fault=name.encode())

    def devices(self) -> NDArray[Any]:
        """What is known of the devices, (1,) ``hardware.devices.DEVICES``; at first zeros."""
        return self._read_or_zero(self._devices, DEVICES)

    def emergency_stop(self) -> int:
        """Stop all motion: control acts on it in the tick in which it sees it.

        It waits for nothing, and what was requested before it and not yet taken in is dropped.

        Returns:
            The number to wait for, as for every request.
        """
        with self._emergency_lock:
            press = np.zeros(1, dtype=EMERGENCY)
            press["count"] = self._emergency.sequence + 1
            press["stamp_ns"] = time.monotonic_ns()
            self._emergency.write(press)
        return self._send(Request.EMERGENCY_STOP)

    def leader(
        self,
        kind: LeaderKind,
        *,
        sequence: int,
        clutch: bool,
        position: Any,
        wxyz: Any,
        absolute: bool,
        smoothing_s: float,
        timeout_s: float,
        mode: DriveMode = DriveMode.BOTH,
    ) -> None:
        """Publish a leader's newest sample; the one before is forgotten.

        Args:
            kind: one of ``LEADER_KINDS``.
            sequence: grows with each new sample.
            clutch: whether the leader is engaged.
            position: (3,) in m.
            wxyz: (4,) quaternion w, x, y, z.
            absolute: the pose is a tip pose in the base frame, not a motion relative to the
                clutch's anchor.
            smoothing_s: time constant over which coarse samples are interpolated; 0 for none.
            timeout_s: older than this, a sample with a closed clutch is stale.
            mode: what the leader drives.

        Raises:
            InvalidPose: NaN, infinity, or a quaternion that is nearly zero; nothing is published.
        """
        self._leaders[kind].write(
            sequence=sequence,
            clutch=clutch,
            position=position,
            wxyz=wxyz,
            absolute=absolute,
            smoothing_s=smoothing_s,
            timeout_s=timeout_s,
            mode=mode,
        )

    def hold(self, down: bool) -> None:
        """Say whether hold-to-move is pressed; repeat a press at least every 0.3 s."""
        with self._lock:
            sample = np.zeros(1, dtype=HOLD_SLOT)
            sample["down"], sample["stamp_ns"] = int(down), time.monotonic_ns()
            self._hold.write(sample)

    def alive(self) -> None:
        """Say that the web server's event loop lives; call it from there, 5 to 20 times a second.

        From the first call on, control takes 1 s of silence as the loss of the operator.
        """
        sample = np.zeros(1, dtype=ALIVE)
        sample["stamp_ns"] = time.monotonic_ns()
        with self._lock:
            self._alive.write(sample)

    def snapshot(self) -> NDArray[Any]:
        """The newest record, shape (1,).

        Raises:
            MappedReadError: control has not published any yet.
        """
        return self._record.read()

    def ring(self) -> MappedRing:
        """A reader of every record of the last seconds; the caller closes it."""
        return MappedRing(self._directory / RECORD_RING_FILE, self.types.record)

    def status(self) -> dict[str, Any]:
        """What is known of the control process.

        Returns:
            ``control`` ("starting", "running" or "down"), ``phase``, ``message``, ``pid``,
            ``rate_hz``, ``realtime``, ``plant``, ``board``, ``trocar_source``,
            ``trocar_registered`` ((3,), m), ``breathing``, ``control_restarts``, ``web_restarts``
            and ``paths`` (names by path id).
        """
        status = self._read_or_zero(self._status, STATUS)[0]
        supervision = self._read_or_zero(self._supervision, SUPERVISION)[0]
        # A control process that has not spoken yet leaves the words of the one before it.
        spoken = status["pid"] == supervision["control_pid"]
        phase = Phase(int(status["phase"])) if spoken else Phase.STARTING
        state = ControlState(int(supervision["control"]))
        if state != ControlState.DOWN:
            state = ControlState.RUNNING if phase == Phase.RUNNING else ControlState.STARTING
        message = supervision["message"] or (status["message"] if spoken else b"starting")
        with self._lock:
            paths = dict(self._paths)
        return {
            "control": state.name.lower(),
            "phase": phase.name.lower(),
            "message": message.decode(errors="replace"),
            "pid": int(supervision["control_pid"]),
            "rate_hz": float(status["rate_hz"]),
            "realtime": status["realtime"].decode(errors="replace"),
            "plant": status["plant"].decode(errors="replace"),
            "board": status["board"].decode(errors="replace"),
            "trocar_source": TrocarSource(int(status["trocar_source"])),
            "trocar_registered": status["trocar_registered"].copy(),
            "breathing": Breathing(
                float(status["breathing_amplitude"]), float(status["breathing_period"])
            ),
            "control_restarts": int(supervision["control_restarts"]),
            "web_restarts": int(supervision["web_restarts"]),
            "paths": paths,
        }

    @staticmethod
    def _read_or_zero(slot: MappedSlot, dtype: np.dtype[Any]) -> NDArray[Any]:
        try:
            return slot.read()
        except MappedReadError:
            return np.zeros(1, dtype=dtype)

    def _send(self, kind: int, **fields: Any) -> int:
        with self._lock:
            return self._send_locked(kind, **fields)

    def _send_locked(self, kind: int, **fields: Any) -> int:
        message = np.zeros(1, dtype=self._request_type)
        number = self._requests.sequence + 1
        message["sequence"], message["kind"] = number, int(kind)
        message["stamp_ns"] = time.monotonic_ns()
        for name, value in fields.items():
            message[name] = value
        self._requests.push(message)
        return number

    def _write_file(self, name: str, content: bytes) -> None:
        unfinished = self._directory / f".{name}.new"
        unfinished.write_bytes(content)
        unfinished.chmod(0o600)
        os.replace(unfinished, self._directory / name)

    def _known_paths(self) -> dict[int, str]:
        try:
            found = json.loads((self._directory / _PATHS_FILE).read_bytes())
        except (OSError, ValueError):
            return {}
        return {int(path_id): str(name) for path_id, name in found.items()}

    def close(self) -> None:
        """Unmap every file."""
        slots = [self._record, self._status, self._supervision, self._devices]
        slots += [self._emergency, self._hold, self._alive]
        for slot in slots + list(self._leaders.values()):
            slot.close()
        self._requests.close()


def _check_path(rows: NDArray[np.float64]) -> None:
    """Refuse what cannot be interpolated, before the control process has to."""
    if rows.ndim != 2 or rows.shape[1] != PATH_COLUMNS or len(rows) < 2:
        raise InvalidPose("path", f"has shape {rows.shape}, not (two or more, {PATH_COLUMNS})")
    if not np.isfinite(rows).all():
        raise InvalidPose("path", "holds NaN or infinity")
    if rows[0, 0] != 0.0 or not (np.diff(rows[:, 0]) > 0.0).all():
        raise InvalidPose("path", "its times must start at 0 and increase")
    if not (np.linalg.norm(rows[:, 4:8], axis=1) > SMALLEST_QUATERNION).all():
        raise InvalidPose("path", "holds a zero quaternion")
