"""What is known of the stylus, for the page and the API: a mapped slot, or a record in memory."""

from __future__ import annotations

import math
import os
import time
from collections import deque
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from server.leaders.stylus_input import StylusCounts, StylusInput
from server.memory.mapped import MappedReadError, MappedSlot
from server.memory.stylus_records import STYLUS_COUNTS, STYLUS_STATUS, STYLUS_STATUS_FILE

SILENT_NS = 2_000_000_000
"""A leader process that has said nothing for so long is not there."""

SAY_NS = 100_000_000
"""How often it speaks."""

_WINDOW_NS = 1_000_000_000

assert set(STYLUS_COUNTS) == set(StylusCounts.__dataclass_fields__)


class StylusReport:
    """Fills a (1,) STYLUS_STATUS from the input of one stylus.

    Args:
        url: where it is connected to.
    """

    def __init__(self, url: str) -> None:
        self.record = np.zeros(1, STYLUS_STATUS)
        self.record["url"] = url.encode()[:255]
        self.record["pid"] = os.getpid()
        self._seen: deque[tuple[int, int]] = deque()
        self._largest_delay_ns = 0

    def saw(self, stylus: StylusInput, now_ns: int) -> None:
        """A batch of samples was taken in."""
        self._largest_delay_ns = max(self._largest_delay_ns, stylus.delay_ns)
        if not self._seen or now_ns - self._seen[-1][0] >= SAY_NS:
            self._seen.append((now_ns, stylus.counts.samples))
        while now_ns - self._seen[0][0] > _WINDOW_NS:
            self._seen.popleft()

    def fill(
        self,
        stylus: StylusInput,
        *,
        connected: bool,
        message: str,
        force: tuple[float, float, float],
        now_ns: int,
    ) -> NDArray[Any]:
        """The record, (1,), filled with what holds now."""
        self.saw(stylus, now_ns)
        record, (since_ns, before) = self.record[0], self._seen[0]
        elapsed = (now_ns - since_ns) * 1e-9
        record["rate_hz"] = (stylus.counts.samples - before) / elapsed if elapsed > 0.0 else 0.0
        record["connected"], record["stamp_ns"] = int(connected), now_ns
        record["sample_ns"], record["delay_ns"] = stylus.sample_ns, self._largest_delay_ns
        self._largest_delay_ns = 0
        record["clutch"], record["mode"] = int(stylus.clutch), int(stylus.mode)
        record["buttons"] = stylus.buttons.bits
        record["buttons_repeat"] = int(stylus.buttons.repeats)
        record["force_n"] = math.sqrt(sum(part * part for part in force))
        for name, value in asdict(stylus.counts).items():
            record["counts"][name] = value
        record["message"] = (message or stylus.why_not).encode()[:255]
        return self.record


class StylusStatusFile:
    """The mapped slot in which the leader process tells what it knows.

    Args:
        directory: the run directory.
        writable: open it to write.

    Raises:
        MappedFileError: no console keeps its files there.
    """

    def __init__(self, directory: Path, *, writable: bool = False) -> None:
        self._slot = MappedSlot(directory / STYLUS_STATUS_FILE, STYLUS_STATUS, writable=writable)

    def write(self, status: NDArray[Any]) -> None:
        """Publish a (1,) STYLUS_STATUS."""
        self._slot.write(status)

    def read(self) -> NDArray[Any] | None:
        """The newest, (1,); None where there is no leader process, or it is silent."""
        try:
            status = self._slot.read()
        except MappedReadError:
            return None
        silent = time.monotonic_ns() - int(status["stamp_ns"][0]) > SILENT_NS
        return None if silent else status

    def close(self) -> None:
        """Unmap the file."""
        self._slot.close()
