"""What the console did, from the records of every tick: when it noticed, how far it still went."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.records import RECORD, Safety
from server.memory.link_records import RECORD_RING_FILE
from server.memory.mapped import MappedRing

Records = NDArray[Any]
_POLL_S = 0.01


class Watch:
    """Every record of the control process since :meth:`mark`.

    Args:
        directory: the console's run directory.

    Attributes:
        lost: whether records were overwritten before they were read.
    """

    def __init__(self, directory: Path) -> None:
        self._ring = MappedRing(directory / RECORD_RING_FILE, RECORD)
        self._next = self._ring.sequence
        self._parts: list[Records] = []
        self.lost = False

    def mark(self) -> None:
        """Forget what was, and begin anew with the next record."""
        self._next, self._parts = self._ring.sequence, []

    def take(self) -> Records:
        """The records since the last call, (n,) RECORD; they are not kept."""
        found, self._next, lost = self._ring.read_since(self._next)
        self.lost |= lost
        return found

    def records(self) -> Records:
        """All records since the mark, (n,) RECORD."""
        found = self.take()
        if len(found):
            self._parts.append(found)
        if len(self._parts) > 1:
            self._parts = [np.concatenate(self._parts)]
        return self._parts[0] if self._parts else np.empty(0, RECORD)

    def until(self, shows: Callable[[Records], NDArray[Any]], within_s: float) -> int | None:
        """Place of the first record since the mark that ``shows`` it, or None in ``within_s``.

        Args:
            shows: a truth value for each of (n,) records.
            within_s: how long to wait, s.
        """
        ends = time.monotonic() + within_s
        while True:
            found = np.flatnonzero(shows(self.records()))
            if len(found):
                return int(found[0])
            if time.monotonic() > ends:
                return None
            time.sleep(_POLL_S)

    def newest(self) -> Records:
        """The newest record, (1,)."""
        found, _, _ = self._ring.read_since(max(0, self._ring.sequence - 1))
        return found[-1:]

    def close(self) -> None:
        """Unmap the ring."""
        self._ring.close()


def safety(records: Records) -> NDArray[Any]:
    """The safety state of each record."""
    return np.asarray(records["outcome"]["state"]["safety"])


def reason(records: Records) -> NDArray[Any]:
    """The event behind the safety state of each record."""
    return np.asarray(records["outcome"]["state"]["reason"])


def path_mm(positions: NDArray[Any]) -> float:
    """Length in mm of the way through (n, 3) positions in m."""
    if len(positions) < 2:
        return 0.0
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()) * 1e3


def commanded_path_mm(records: Records) -> float:
    """How far the commanded tip went, mm."""
    return path_mm(records["outcome"]["report"]["commanded_position"])


def reach_mm(records: Records) -> float:
    """How far the true (without a simulator: the measured) tip came from where it was first, mm.

    Not the length of its way: standing still, a measurement that is never quite the same adds up.
    """
    positions = records["truth"]["position"]
    if len(positions) < 2:
        return 0.0
    return float(np.nanmax(np.linalg.norm(positions - positions[0], axis=1), initial=0.0)) * 1e3


def after(records: Records, place: int, seconds: float) -> Records:
    """The records from ``place`` on for so long, by their stamps."""
    tail = records[place:]
    if not len(tail):
        return tail
    until_ns = tail["header"]["stamp_ns"][0] + round(seconds * 1e9)
    return np.asarray(tail[tail["header"]["stamp_ns"] <= until_ns])


def stands_still(records: Records) -> bool:
    """Whether no record commands motion, and none is ENABLED."""
    moving = records["outcome"]["command"]["moving"] != 0
    return not bool((moving | (safety(records) == Safety.ENABLED)).any())
