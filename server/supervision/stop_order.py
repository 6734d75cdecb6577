"""The second emergency stop: a signal to the control process, past web, network and every file.

Control takes SIGUSR1 as an emergency stop. Whether it did is read from its records.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time

from robot.records import Safety
from robot.safety import Event
from server.memory.mapped import MappedReadError, MappedSlot

POLL_S = 0.0005


class StopOrder:
    """Sends the signal and looks for its effect.

    Args:
        records: the slot with the newest record.
    """

    def __init__(self, records: MappedSlot) -> None:
        self._records = records
        self._sent_ns = 0

    def send(self, control_pid: int) -> bool:
        """Order control to stop; tells whether there was a process to order."""
        self._sent_ns = time.monotonic_ns()
        if control_pid <= 0:
            return False
        with contextlib.suppress(OSError):
            os.kill(control_pid, signal.SIGUSR1)
            return True
        return False

    def took_ms(self) -> float | None:
        """From the order to the first record seen in FAULT after it; None before there is one."""
        try:
            record = self._records.read()
        except MappedReadError:
            return None
        state, stamp_ns = record["outcome"]["state"], int(record["header"]["stamp_ns"][0])
        stopped = state["safety"][0] == Safety.FAULT and state["reason"][0] == Event.EMERGENCY_STOP
        if not stopped or stamp_ns < self._sent_ns:
            return None
        return (stamp_ns - self._sent_ns) * 1e-6

    def wait(self, patience_s: float) -> float | None:
        """Wait for the effect; milliseconds it took, None when there was none in time."""
        ends = time.monotonic() + patience_s
        while (took := self.took_ms()) is None and time.monotonic() < ends:
            time.sleep(POLL_S)
        return took
