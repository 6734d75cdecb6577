"""How often the bus cycles, how long a cycle takes, and what that costs, in windows of a second."""

from __future__ import annotations

import time

_WINDOW_NS = 1_000_000_000
_MOST = 2048


class CycleTimes:
    """Figures of the last whole window; the thread that cycles calls everything here.

    Attributes:
        cycles: complete ones so far.
        missed: others so far.
        rate_hz: complete cycles a second.
        median_ms: from the beginning of a cycle until its answers have been taken in.
        p99_ms: likewise.
        cpu_percent: of one core, used by this thread.
    """

    def __init__(self) -> None:
        self.cycles = self.missed = 0
        self.rate_hz = self.median_ms = self.p99_ms = self.cpu_percent = 0.0
        self._durations: list[int] = []
        self.restart()

    def restart(self) -> None:
        """Begin a window now."""
        self._begin_ns, self._cpu_ns = time.monotonic_ns(), time.thread_time_ns()
        self._complete = 0
        self._durations.clear()

    def add(self, begin_ns: int, end_ns: int, complete: bool) -> None:
        """Count one cycle."""
        if complete:
            self.cycles += 1
            self._complete += 1
        else:
            self.missed += 1
        if len(self._durations) < _MOST:
            self._durations.append(end_ns - begin_ns)
        if end_ns - self._begin_ns >= _WINDOW_NS:
            self._finish(end_ns)

    def _finish(self, now_ns: int) -> None:
        seconds = (now_ns - self._begin_ns) * 1e-9
        durations = sorted(self._durations)
        self.rate_hz = self._complete / seconds
        self.median_ms = durations[len(durations) // 2] * 1e-6
        self.p99_ms = durations[min(len(durations) - 1, len(durations) * 99 // 100)] * 1e-6
        self.cpu_percent = (time.thread_time_ns() - self._cpu_ns) * 1e-7 / seconds
        self.restart()
