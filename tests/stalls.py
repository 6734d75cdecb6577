"""When the machine stood still: sleepers on every processor that say when they were woken too late.

What is tested in real time fails with reason where a virtual machine is stopped by its host for
longer than a watchdog waits. Such a failure proves nothing, so ``tests/conftest.py`` lets the
test run once more; one without a stall stands at once.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from typing import NamedTuple

LONGEST_MS = 10.0
"""What is woken later than this has missed two cycles of the servo bus and five of control."""

_SLEEP_S = 0.01


class Stall(NamedTuple):
    """A time in which a process that wanted to run did not."""

    ended_s: float
    """Of the monotonic clock."""

    lasted_ms: float


class StallWatch:
    """Watches for stalls from its making until it is closed.

    Attributes:
        process: the one that sleeps.
    """

    def __init__(self) -> None:
        self._written = tempfile.TemporaryFile()  # noqa: SIM115 - closed by close()
        command = [sys.executable, "-S", __file__]
        self.process = subprocess.Popen(command, stdout=self._written)

    def since(self, began_s: float) -> list[Stall]:
        """Stalls that ended after an instant of the monotonic clock."""
        # Reading by place leaves the process its own place in the file.
        size = os.fstat(self._written.fileno()).st_size
        lines = os.pread(self._written.fileno(), size, 0).decode().splitlines()
        found = [Stall(*map(float, line.split())) for line in lines]
        return [stall for stall in found if stall.ended_s > began_s]

    def close(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.wait()
        self._written.close()


def in_words(stalls: Sequence[Stall]) -> str:
    """How often and how long the machine stood still; there is at least one stall."""
    longest = max(stall.lasted_ms for stall in stalls)
    return (
        f"keyhole: the machine stood still for more than {LONGEST_MS:g} ms {len(stalls)} times, "
        f"at most for {longest:.0f} ms"
    )


def watch(processor: int) -> None:
    """Write every stall as a line of its end (s) and its length (ms), while the parent lives."""
    os.sched_setaffinity(0, {processor})
    parent = os.getppid()
    before = time.monotonic()
    while os.getppid() == parent:
        time.sleep(_SLEEP_S)
        now = time.monotonic()
        late_ms = (now - before - _SLEEP_S) * 1e3
        if late_ms > LONGEST_MS:
            os.write(sys.stdout.fileno(), f"{now:.4f} {late_ms:.1f}\n".encode())
        before = now


if __name__ == "__main__":
    # One processor may stand still while the other goes on, so each has its sleeper.
    for processor in os.sched_getaffinity(0):
        threading.Thread(target=watch, args=(processor,)).start()
