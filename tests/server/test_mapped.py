"""Mapped records: no torn record is ever accepted, and nobody can hold up the writer."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.records import RECORD
from server.memory.mapped import MappedFileError, MappedReadError, MappedRing, MappedSlot

ROOT = Path(__file__).resolve().parents[2]
WIDE = np.dtype([("values", "i8", 512)])
"""Every value of a whole record is the same: one that differs would show a torn read."""

WRITER = """
import sys, numpy as np
from tests.server.test_mapped import WIDE
from server.memory.mapped import MappedRing, MappedSlot
kind, path = sys.argv[1:]
file = (MappedSlot if kind == "slot" else MappedRing)(path, WIDE, writable=True)
write = file.write if kind == "slot" else file.push
record = np.zeros(1, WIDE)
print("ready", flush=True)
while True:
    record["values"] += 1
    write(record)
"""

READER = """
import sys
from tests.server.test_mapped import WIDE
from server.memory.mapped import MappedSlot
slot = MappedSlot(sys.argv[1], WIDE)
print("ready", flush=True)
while True:
    slot.read()
"""


def wide(value: int) -> NDArray[Any]:
    record = np.zeros(1, dtype=WIDE)
    record["values"] = value
    return record


@contextlib.contextmanager
def running(source: str, *arguments: str) -> Iterator[None]:
    """A program in a process of its own, killed at the end, whatever it is doing."""
    command = [sys.executable, "-c", source, *arguments]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == b"ready\n"
            yield
        finally:
            process.kill()


def test_a_slot_gives_back_what_was_written(tmp_path: Path) -> None:
    slot = MappedSlot(tmp_path / "a", RECORD, create=True)
    record = np.zeros(1, dtype=RECORD)
    record["header"]["tick"], record["header"]["robot"] = 7, b"instrument"
    record["truth"]["position"] = (1.0, -0.0, np.nan)
    slot.write(record)
    assert MappedSlot(tmp_path / "a", RECORD).read().tobytes() == record.tobytes()


def test_an_empty_slot_says_so(tmp_path: Path) -> None:
    slot = MappedSlot(tmp_path / "a", RECORD, create=True)
    with pytest.raises(MappedReadError, match="nothing was written yet"):
        slot.read()


def test_no_torn_record_is_accepted_from_a_writer_at_full_speed(tmp_path: Path) -> None:
    slot = MappedSlot(tmp_path / "a", WIDE, create=True)
    slot.write(wide(0))
    out, last, reads = wide(0), 0, 0
    with running(WRITER, "slot", str(slot.path)):
        ends = time.monotonic() + 2.0
        while time.monotonic() < ends:
            values = slot.read(out)["values"][0]
            assert (values == values[0]).all()
            assert values[0] >= last
            last, reads = int(values[0]), reads + 1
    assert reads > 1000
    assert last > 1000


def test_a_killed_writer_leaves_the_last_whole_record(tmp_path: Path) -> None:
    path = tmp_path / "a"
    MappedSlot(path, WIDE, create=True).close()
    for _ in range(5):
        with running(WRITER, "slot", str(path)):
            time.sleep(0.03)
        slot = MappedSlot(path, WIDE, writable=True)
        values = slot.read()["values"][0]
        assert (values == values[0]).all()
        slot.write(wide(-1))
        assert slot.read()["values"][0, 0] == -1


def test_a_writer_stopped_in_the_middle_of_a_record_is_not_seen(tmp_path: Path) -> None:
    slot = MappedSlot(tmp_path / "a", WIDE, create=True)
    slot.write(wide(1))
    slot.write(wide(2))
    # What a writer leaves that is killed after half of the third record.
    place = 3 % 2
    slot._payloads[place][: WIDE.itemsize // 2] = 3
    assert (slot.read()["values"] == 2).all()


def test_a_damaged_record_is_refused(tmp_path: Path) -> None:
    slot = MappedSlot(tmp_path / "a", WIDE, create=True)
    slot.write(wide(1))
    slot._payloads[1][100] ^= 1
    with pytest.raises(MappedReadError, match="no whole record"):
        slot.read()
    slot.write(wide(2))
    assert (slot.read()["values"] == 2).all()


def test_a_killed_reader_does_no_harm(tmp_path: Path) -> None:
    slot = MappedSlot(tmp_path / "a", WIDE, create=True)
    slot.write(wide(1))
    for _ in range(3):
        with running(READER, str(slot.path)):
            for value in range(200):
                slot.write(wide(value))
    assert (slot.read()["values"] == 199).all()
    assert slot.path.exists()


def test_a_ring_gives_every_record_once_and_in_order(tmp_path: Path) -> None:
    ring = MappedRing(tmp_path / "a", WIDE, 100, create=True)
    reader = MappedRing(tmp_path / "a", WIDE)
    assert reader.capacity == 100
    following, seen = 0, []
    for value in range(350):
        assert ring.push(wide(value)) == value
        if value % 90 == 0:
            records, following, gap = reader.read_since(following)
            assert not gap
            seen += records["values"][:, 0].tolist()
    records, following, gap = reader.read_since(following)
    assert not gap
    assert seen + records["values"][:, 0].tolist() == list(range(350))
    records, following, gap = reader.read_since(following)
    assert (len(records), following, gap) == (0, 350, False)


def test_a_ring_tells_of_a_gap(tmp_path: Path) -> None:
    ring = MappedRing(tmp_path / "a", WIDE, 10, create=True)
    for value in range(25):
        ring.push(wide(value))
    records, following, gap = ring.read_since(3)
    assert gap
    assert records["values"][:, 0].tolist() == list(range(15, 25))
    assert following == 25


def test_a_ring_reads_in_portions(tmp_path: Path) -> None:
    ring = MappedRing(tmp_path / "a", WIDE, 10, create=True)
    for value in range(10):
        ring.push(wide(value))
    records, following, gap = ring.read_since(0, limit=4)
    assert (records["values"][:, 0].tolist(), following, gap) == ([0, 1, 2, 3], 4, False)


def test_a_ring_read_at_full_speed_is_whole_and_its_gaps_are_told(tmp_path: Path) -> None:
    ring = MappedRing(tmp_path / "a", WIDE, 64, create=True)
    following, expected, seen, gap = 0, 1, 0, False
    with running(WRITER, "ring", str(ring.path)):
        ends = time.monotonic() + 2.0
        while time.monotonic() < ends:
            records, following, lost = ring.read_since(following)
            # A reader that is stopped while it copies may get nothing but the word of a gap.
            gap |= lost
            for values in records["values"]:
                assert (values == values[0]).all()
                if not gap:
                    assert values[0] == expected
                gap = False
                expected = int(values[0]) + 1
                seen += 1
    assert seen > 1000


def test_a_new_writer_goes_on_counting(tmp_path: Path) -> None:
    MappedRing(tmp_path / "a", WIDE, 8, create=True).push(wide(0))
    second = MappedRing(tmp_path / "a", WIDE, writable=True)
    assert second.push(wide(1)) == 1
    assert second.read_since(0)[0]["values"][:, 0].tolist() == [0, 1]


def test_a_file_of_other_records_is_refused(tmp_path: Path) -> None:
    MappedSlot(tmp_path / "a", WIDE, create=True)
    other = np.dtype([("numbers", "i8", 512)])
    with pytest.raises(MappedFileError, match="another type"):
        MappedSlot(tmp_path / "a", other)
    with pytest.raises(MappedFileError, match="not a file of such records"):
        MappedSlot(tmp_path / "a", RECORD)
    with pytest.raises(MappedFileError, match="No such file"):
        MappedSlot(tmp_path / "b", WIDE)
    (tmp_path / "c").write_bytes(b"short")
    with pytest.raises(MappedFileError):
        MappedSlot(tmp_path / "c", WIDE)
    (tmp_path / "d").write_bytes((tmp_path / "a").read_bytes()[:200])
    with pytest.raises(MappedFileError):
        MappedSlot(tmp_path / "d", WIDE)


def test_a_reader_cannot_write(tmp_path: Path) -> None:
    MappedSlot(tmp_path / "a", WIDE, create=True)
    with pytest.raises(TypeError):
        MappedSlot(tmp_path / "a", WIDE).write(wide(1))


def test_files_are_closed_to_others(tmp_path: Path) -> None:
    slot = MappedSlot(tmp_path / "a", WIDE, create=True)
    assert os.stat(slot.path).st_mode & 0o077 == 0
    slot.close()
    slot.close()
