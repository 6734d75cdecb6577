"""Every change of the safety state, from the lossless ring of records into the audit log.

It runs in the recorder process, so that it goes on while the web process is started again. A
recorder that is started anew goes on behind the last change that stands in the log.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.records import LeaderKind, RecordTypes, Safety
from robot.safety import REASONS, Event
from server.audit.reader import newest
from server.audit.writer import AuditLog
from server.memory.link_records import RECORD_RING_FILE
from server.memory.mapped import MappedRing

STATE_CHANGED = "state_changed"
_AT_ONCE = 500


class TransitionWatch:
    """Notes each change of state or reason once.

    Args:
        directory: the run directory.
        log: of this process; it has a folder.
        types: of the robot.
    """

    def __init__(self, directory: Path, log: AuditLog, types: RecordTypes) -> None:
        self._log = log
        self._ring = MappedRing(directory / RECORD_RING_FILE, types.record)
        self._sequence, self._known = 0, (-1, -1)
        assert log.where is not None
        for entry in reversed(newest(log.where, 50, event=STATE_CHANGED)):
            if entry.get("run") == log.run and isinstance(entry.get("record"), int):
                self._sequence = entry["record"] + 1
                self._known = (_number(Safety, entry["state"]), _number(Event, entry["reason"]))
                break

    def step(self) -> None:
        """Take in what control has published since; call it more often than the ring turns."""
        while True:
            records, following, lost = self._ring.read_since(self._sequence, _AT_ONCE)
            if lost and self._sequence:
                words = "records were overwritten before they were read; a change may be missing"
                self._log.note("records_lost", words, record=self._sequence)
            self._sequence = following
            if len(records) == 0:
                return
            self._take(records, following - len(records))

    def _take(self, records: NDArray[Any], first: int) -> None:
        state = records["outcome"]["state"]
        pairs = np.stack((state["safety"], state["reason"]), axis=1)
        before = np.vstack((np.array(self._known), pairs[:-1]))
        for index in np.flatnonzero((pairs != before).any(axis=1)):
            self._note(records[index], first + int(index), int(before[index, 0]))
        self._known = (int(pairs[-1, 0]), int(pairs[-1, 1]))

    def _note(self, record: np.void, number: int, before: int) -> None:
        state, header = record["outcome"]["state"], record["header"]
        safety, event = Safety(int(state["safety"])), Event(int(state["reason"]))
        reason, action = REASONS[event]
        came_from = Safety(before).name if before in set(Safety) else None
        self._log.note(
            STATE_CHANGED,
            f"{safety.name}: {reason}",
            record=number,
            state=safety.name,
            before=came_from,
            reason=event.name,
            action=action,
            tick=int(header["tick"]),
            time_s=round(int(header["time_ns"]) * 1e-9, 6),
            stamp_ns=int(header["stamp_ns"]),
            leader=LeaderKind(int(state["leader_kind"])).name.lower(),
            engaged=bool(state["engaged"]),
            tip_mm=[round(float(part) * 1e3, 3) for part in _tip(record)],
        )

    def close(self) -> None:
        """Unmap the ring."""
        self._ring.close()


def _tip(record: np.void) -> NDArray[np.float64]:
    position: NDArray[np.float64] = record["outcome"]["report"]["commanded_position"]
    return position


def _number(words: type[Safety] | type[Event], name: object) -> int:
    return int(words[name]) if isinstance(name, str) and name in words.__members__ else -1
