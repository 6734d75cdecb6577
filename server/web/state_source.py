"""The newest state, for everything in the web process that asks for it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from hardware.devices import DEVICES
from robot.configuration import Configuration
from robot.records import Safety
from server.memory.link import WebLink
from server.memory.mapped import MappedReadError
from server.memory.recording_link import RecordingLink
from server.memory.replay_link import ReplayLink
from server.web.access import Caller
from server.web.lease import Lease
from server.web.refusals import ControlSilent
from server.web.robot_messages import messages_of
from server.web.state_message import OperatorView, Surroundings

SILENT_NS = 1_000_000_000
"""Control counts as down when its newest record is older."""

_STATUS_NS = 100_000_000
_SHARED_NS = 4_000_000
_METER_NS = 2_000_000_000
_METER_STEP_NS = 100_000_000


class LoopMeter:
    """Rate of the loop and real-time factor over the last seconds, from the records seen."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int, int]] = deque()

    def take(self, record: NDArray[Any]) -> None:
        """Take a (1,) record in."""
        header = record["header"][0]
        stamp, now = int(header["stamp_ns"]), (int(header["tick"]), int(header["time_ns"]))
        seen = self._seen
        if seen and (now[0] < seen[-1][1] or stamp < seen[-1][0]):
            seen.clear()
        if seen and stamp - seen[-1][0] < _METER_STEP_NS:
            return
        seen.append((stamp, *now))
        while stamp - seen[0][0] > _METER_NS:
            seen.popleft()

    def measure(self) -> tuple[float | None, float | None]:
        """Ticks per second of host time, and plant time over host time; None where not known."""
        if len(self._seen) < 2:
            return None, None
        first, last = self._seen[0], self._seen[-1]
        elapsed = last[0] - first[0]
        return (last[1] - first[1]) * 1e9 / elapsed, (last[2] - first[2]) / elapsed


class StateSource:
    """State messages from the newest record. Belongs to the event loop.

    Args:
        link: to the control process.
        configuration: of the robot.
        lease: who drives.
        clock_ns: the host's monotonic clock.
        recorder: tells whether records are written down; None without a recorder.
        replay: tells what is shown of a recording; None where there is a robot.

    Attributes:
        newest_tick: tick of the newest record read.
    """

    def __init__(
        self,
        link: WebLink,
        configuration: Configuration,
        lease: Lease,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        recorder: RecordingLink | None = None,
        replay: ReplayLink | None = None,
    ) -> None:
        self._recorder, self._replay, self._records = recorder, replay, False
        self._link, self._lease, self._clock_ns = link, lease, clock_ns
        self._messages = messages_of(configuration)
        self._meter = LoopMeter()
        self._status: dict[str, Any] = {}
        self._devices = np.zeros(1, DEVICES)
        self._status_at = -_STATUS_NS
        self._texts: dict[bool, tuple[int, str]] = {}
        self.newest_tick = 0

    def record(self) -> NDArray[Any] | None:
        """The newest record, (1,), or None before the first."""
        try:
            record = self._link.snapshot()
        except MappedReadError:
            return None
        self._meter.take(record)
        self.newest_tick = int(record["header"]["tick"][0])
        return record

    def fresh_record(self) -> NDArray[Any]:
        """The newest record, (1,), of a control process that lives.

        Raises:
            ControlSilent: there is none, or it is old.
        """
        record = self.record()
        around = self._surroundings(record)
        if record is None or around.control != "running":
            raise ControlSilent(around.control_words or f"control is {around.control}")
        return record

    def safety(self) -> Safety | None:
        """The safety state, None while control does not live."""
        record = self.record()
        if record is None or self._surroundings(record).control != "running":
            return None
        return Safety(int(record["outcome"]["state"]["safety"][0]))

    def message(self, caller: Caller) -> dict[str, Any]:
        """The state message as ``caller`` sees it."""
        return self._message(self._lease.is_held_by(caller))

    def text(self, caller: Caller) -> str:
        """The state message as JSON; clients that ask at the same moment share one."""
        you, now = self._lease.is_held_by(caller), self._clock_ns()
        made_at, text = self._texts.get(you, (-_SHARED_NS, ""))
        if now - made_at > _SHARED_NS:
            text = msgspec.json.encode(self._message(you)).decode()
            self._texts[you] = (now, text)
        return text

    def forget_texts(self) -> None:
        """Make the next :meth:`text` anew: something beside the record has changed."""
        self._texts.clear()
        self._status_at = -_STATUS_NS

    def load(self) -> None:
        """Find out about what the first message would wait for."""
        self._messages.load()

    def _message(self, you: bool) -> dict[str, Any]:
        record = self.record()
        holder = self._lease.holder
        wish = self._lease.wish
        operator = OperatorView(
            holder.operator if holder else None,
            you,
            self._lease.expires_in_s,
            self._lease.offered_to,
            wish.operator if wish else None,
        )
        return self._messages.message(record, self._surroundings(record), operator)

    def status(self) -> dict[str, Any]:
        """The control process' status, read at most ten times a second."""
        now = self._clock_ns()
        if now - self._status_at >= _STATUS_NS:
            self._status, self._status_at = self._link.status(), now
            self._devices = self._link.devices()
            self._records = self._recorder is not None and self._recorder.status().records
        return self._status

    def _surroundings(self, record: NDArray[Any] | None) -> Surroundings:
        status, now = self.status(), self._clock_ns()
        control, words = str(status["control"]), ""
        if control != "running":
            words = str(status["message"]) or f"control is {control}"
        elif record is None:
            control, words = "starting", "control is starting"
        elif now - int(record["header"]["stamp_ns"][0]) > SILENT_NS:
            control, words = "down", "control has stopped publishing"
        path_id = 0 if record is None else int(record["header"]["path_id"][0])
        # The rate at which a recording is shown says nothing about a loop.
        rate_hz, factor = self._meter.measure() if self._replay is None else (None, None)
        return Surroundings(
            now_ns=now,
            control=control,
            control_words=words,
            plant=str(status["plant"]),
            board=str(status["board"]),
            trocar_source=status["trocar_source"].name.lower(),
            breathing=status["breathing"],
            realtime=str(status["realtime"]),
            path_name=self._path_name(path_id),
            rate_hz=rate_hz,
            real_time_factor=factor,
            devices=self._devices,
            recording=self._records,
            replay=None if self._replay is None else self._replay.status(),
        )

    def _path_name(self, path_id: int) -> str | None:
        if path_id == 0:
            return None
        names: dict[int, str] = self._status["paths"]
        if path_id not in names:
            # A path that was started since the status was read.
            self._status_at = -_STATUS_NS
            names = self.status()["paths"]
        return names.get(path_id)
