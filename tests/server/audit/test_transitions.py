"""No change of the safety state is missed, none is noted twice, whoever is started again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from robot.records import INSTRUMENT, RECORD, Safety
from robot.safety import TRANSITIONS, Event
from server.audit.reader import newest
from server.audit.transitions import STATE_CHANGED, TransitionWatch
from server.audit.writer import AuditLog
from server.memory.link_records import RECORD_RING_FILE
from server.memory.mapped import MappedRing


@pytest.fixture
def ring(tmp_path: Path) -> Iterator[MappedRing]:
    made = MappedRing(tmp_path / RECORD_RING_FILE, RECORD, 400, create=True)
    yield made
    made.close()


class Watched:
    """One recorder process after the other, on the same ring."""

    def __init__(self, folder: Path) -> None:
        self._folder, self.where = folder, folder / "audit"
        self._start()

    def _start(self) -> None:
        self._log = AuditLog("recorder", self.where, "1")
        self._watch = TransitionWatch(self._folder, self._log, INSTRUMENT)

    def step(self) -> None:
        self._watch.step()

    def end(self) -> None:
        self._watch.close()
        self._log.close(30.0)

    def start_again(self) -> None:
        self.end()
        self._start()

    def noted(self) -> list[tuple[str, str]]:
        found = newest(self.where, 1000, event=STATE_CHANGED)
        return [(entry["state"], entry["reason"]) for entry in found]


def publish(ring: MappedRing, rows: list[tuple[int, int]]) -> list[tuple[str, str]]:
    """Publish ticks in these states; returns the changes among them, the first one included."""
    record = np.zeros(1, RECORD)
    changes: list[tuple[str, str]] = []
    for tick, (safety, reason) in enumerate(rows):
        state = record["outcome"]["state"]
        state["safety"], state["reason"] = safety, reason
        record["header"]["tick"] = tick
        ring.push(record)
        name = (Safety(safety).name, Event(reason).name)
        if not changes or changes[-1] != name:
            changes.append(name)
    return changes


def test_every_change_is_noted_once_through_restarts(
    tmp_path: Path, ring: MappedRing, rng: np.random.Generator
) -> None:
    watched = Watched(tmp_path)
    rows: list[tuple[int, int]] = []
    for row in rng.choice(len(TRANSITIONS), 120):
        transition = TRANSITIONS[row]
        rows += [(int(transition.next), int(transition.event))] * int(rng.integers(1, 8))
    expected = publish(ring, [])
    start = 0
    while start < len(rows):
        count = int(rng.integers(1, 200))
        part = publish(ring, rows[start : start + count])
        expected += part[1:] if expected and expected[-1] == part[0] else part
        start += count
        watched.step()
        if rng.random() < 0.5:
            watched.start_again()
    watched.end()
    assert watched.noted() == expected
    assert len(expected) > 60
    assert not newest(watched.where, 10, event="records_lost")


def test_changes_from_while_no_recorder_ran_are_found_in_the_ring(
    tmp_path: Path, ring: MappedRing
) -> None:
    watched = Watched(tmp_path)
    publish(ring, [(0, 0)] * 5)
    watched.step()
    watched.end()
    publish(ring, [(1, 1), (3, 5), (0, 4)])
    watched = Watched(tmp_path)
    watched.step()
    watched.end()
    assert watched.noted() == [
        ("DISABLED", "NOTHING"), ("ENABLED", "ENABLE"), ("FAULT", "EMERGENCY_STOP"),
        ("DISABLED", "RESET"),
    ]  # fmt: skip


def test_what_was_overwritten_is_told(tmp_path: Path, ring: MappedRing) -> None:
    watched = Watched(tmp_path)
    publish(ring, [(0, 0)])
    watched.step()
    publish(ring, [(1, 1)] * 1000)
    watched.step()
    watched.end()
    assert len(newest(watched.where, 10, event="records_lost")) == 1
    assert watched.noted()[-1] == ("ENABLED", "ENABLE")


def test_an_entry_tells_when_where_and_what_to_do(tmp_path: Path, ring: MappedRing) -> None:
    watched = Watched(tmp_path)
    publish(ring, [(0, 0), (3, int(Event.TRACKING_ERROR))])
    watched.step()
    watched.end()
    (entry,) = newest(watched.where, 1)
    assert entry["before"] == "DISABLED"
    assert entry["text"] == "FAULT: the robot does not follow its commands"
    assert entry["action"].endswith("then reset")
    assert (entry["tick"], entry["record"]) == (1, 1)
    assert entry["tip_mm"] == [0.0, 0.0, 0.0]
