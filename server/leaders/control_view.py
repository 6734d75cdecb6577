"""What a leader outside the control process must know of it: whether it lives, and what it does."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robot.records import RecordTypes, Safety
from server.memory.link_records import RECORD_SLOT_FILE
from server.memory.mapped import MappedReadError, MappedSlot

SILENT_NS = 100_000_000
"""Control that has published nothing for so long is not waited for."""


class ControlView:
    """The newest record, read where it is asked for.

    Args:
        directory: the run directory.
        types: of the robot.

    Attributes:
        record: (1,) of the robot's type, its memory reused; meaningful while ``lives``.
        lives: whether control had published lately at the last :meth:`update`.
        enabled: whether the robot was ENABLED then.

    Raises:
        MappedFileError: no console keeps its files there.
    """

    def __init__(self, directory: Path, types: RecordTypes) -> None:
        self._slot = MappedSlot(directory / RECORD_SLOT_FILE, types.record)
        self.record = np.zeros(1, types.record)
        self._stamp = self.record["header"]["stamp_ns"]
        self._safety = self.record["outcome"]["state"]["safety"]
        self._seen = 0
        self.lives = self.enabled = False

    def update(self, now_ns: int) -> None:
        """Read the newest record, where there is a new one."""
        sequence = self._slot.sequence
        if sequence != self._seen:
            try:
                self._slot.read(self.record)
                self._seen = sequence
            except MappedReadError:
                # Half a record in the buffer must not be taken for one.
                self._stamp[0] = 0
        self.lives = self._stamp[0] > 0 and now_ns - self._stamp[0] <= SILENT_NS
        self.enabled = self.lives and self._safety[0] == Safety.ENABLED

    def close(self) -> None:
        """Unmap the file."""
        self._slot.close()
