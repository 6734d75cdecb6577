"""Checks a recording: the same inputs through the same controller must give the same bits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.robots import Robot, make_robot
from server.recording.machine import differences
from server.recording.reader import Batch, Recording

_MOST_FIELDS = 8


@dataclass
class Difference:
    """A tick whose outcome is not the recorded one.

    Attributes:
        tick: its number; sequence: the record's; time_s: since the recording's start.
        fields: what differs, as (name, recorded, computed).
    """

    tick: int
    sequence: int
    time_s: float
    fields: list[tuple[str, Any, Any]]


@dataclass
class Verification:
    """What came of a check.

    Attributes:
        checked: ticks computed anew.
        differing: how many of them came out otherwise.
        first: the first of these.
        restarts: where the computation began anew from the recorded state, and why.
        otherwise: versions and machine that are not those of the recording.
    """

    checked: int = 0
    differing: int = 0
    first: Difference | None = None
    restarts: list[str] = field(default_factory=list)
    otherwise: list[str] = field(default_factory=list)


def verify(
    recording: Recording, progress: Callable[[float], None] = lambda _: None
) -> Verification:
    """Feed the recorded inputs through a robot built from the recorded configuration.

    It starts from the state in the first record, and from a later one's again where records are
    missing, the controller was started anew, or it had failed. After a tick that differs it goes
    on from the recorded state, so that the ticks that differ are counted one by one.

    Args:
        recording: open.
        progress: called now and then with the share done.

    Raises:
        RecordingConfiguration: the recorded configuration or calibration is not known.
        RecordingUnreadable: a part of the recording is damaged.
    """
    robot = make_robot(recording.configuration(), recording.calibration())
    return _Check(recording, robot).run(progress)


class _Check:
    def __init__(self, recording: Recording, robot: Robot) -> None:
        self._recording, self._robot = recording, robot
        self._result = Verification(otherwise=differences(recording.metadata))
        self._before: NDArray[Any] | None = None
        self._sequence = 0
        self._outcome = np.zeros(1, recording.types.outcome)

    def run(self, progress: Callable[[float], None]) -> Verification:
        total = len(self._recording.chunks)
        for done, batch in enumerate(self._recording.batches(), start=1):
            for record, sequence, time_ns in _each(batch):
                self._take(record, sequence, (time_ns - self._recording.start_ns) * 1e-9)
            progress(done / total)
        return self._result

    def _take(self, record: NDArray[Any], sequence: int, time_s: float) -> None:
        before = self._before
        why = "" if before is None else self._why_not_next(before, record, sequence)
        if why:
            self._result.restarts.append(f"{time_s:.3f} s: {why}")
        elif before is not None:
            self._compare(before, record, sequence, time_s)
        self._before, self._sequence = record, sequence

    def _why_not_next(self, before: NDArray[Any], record: NDArray[Any], sequence: int) -> str:
        """Why ``record`` cannot be computed from the one before; empty where it can."""
        missing = (sequence - self._sequence - 1) & 0xFFFFFFFF
        tick, last = (int(one["header"]["tick"][0]) for one in (record, before))
        if missing:
            return f"{missing} records are missing"
        if int(record["outcome"]["state"]["tick"][0]) != tick:
            return "the control loop had failed; its last record comes from no tick"
        if tick != last + 1:
            return f"the controller was started anew (tick {tick} after {last})"
        return ""

    def _compare(
        self, before: NDArray[Any], record: NDArray[Any], sequence: int, time_s: float
    ) -> None:
        outcome, recorded = self._outcome, record["outcome"]
        outcome.view(np.uint8)[:] = 0
        self._robot.tick(before["outcome"]["state"], record["input"], outcome)
        self._result.checked += 1
        if outcome.tobytes() == recorded.tobytes():
            return
        self._result.differing += 1
        if self._result.first is None:
            fields = list(_differing(recorded[0], outcome[0], ""))
            tick = int(record["header"]["tick"][0])
            self._result.first = Difference(tick, sequence, time_s, fields)


def _each(batch: Batch) -> Iterator[tuple[NDArray[Any], int, int]]:
    numbers = zip(batch.sequence.tolist(), batch.time_ns.tolist(), strict=True)
    for place, (sequence, time_ns) in enumerate(numbers):
        yield batch.records[place : place + 1], sequence, time_ns


def _differing(recorded: np.void, computed: np.void, name: str) -> Iterator[tuple[str, Any, Any]]:
    """Every innermost field in which two outcomes differ by a bit."""
    assert recorded.dtype.names is not None
    for part in recorded.dtype.names:
        one, other = recorded[part], computed[part]
        path = f"{name}.{part}" if name else part
        if isinstance(one, np.void):
            yield from _differing(one, other, path)
        elif np.asarray(one).tobytes() != np.asarray(other).tobytes():
            yield path, one.tolist(), other.tolist()


def report(recording: Recording, result: Verification) -> str:
    """The outcome of a check in words, line by line."""
    lines = [
        f"{recording.path}: {recording.duration_s:.1f} s, {result.checked} ticks computed anew"
    ]
    if recording.cut:
        lines.append("the recording was cut off; everything before its end is there")
    lines += [f"begun anew from the recorded state at {words}" for words in result.restarts]
    first = result.first
    if first is None:
        lines.append("every state, command and report is the recorded one, bit for bit")
        if result.otherwise:
            lines.append(f"although not made here: {'; '.join(result.otherwise)}")
        return "\n".join(lines)
    lines.append(
        f"{result.differing} ticks differ; the first is tick {first.tick} "
        f"(record {first.sequence}, {first.time_s:.3f} s):"
    )
    for name, was, now in first.fields[:_MOST_FIELDS]:
        lines.append(f"  {name}: recorded {was!r}, computed {now!r}")
    if len(first.fields) > _MOST_FIELDS:
        lines.append(f"  and {len(first.fields) - _MOST_FIELDS} fields more")
    if result.otherwise:
        lines.append(f"made elsewhere, which may be why: {'; '.join(result.otherwise)}")
    else:
        lines.append("versions and machine are those of the recording")
    return "\n".join(lines)
