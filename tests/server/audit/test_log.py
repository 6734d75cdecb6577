"""The audit log's files: whole lines, one for each entry, closed to others, bounded in size."""

from __future__ import annotations

import json
import os
import stat
import threading
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from server.audit import folder as places
from server.audit.reader import newest
from server.audit.throttle import Throttle
from server.audit.writer import AuditLog
from tests.server.console_process import eventually


def written(where: Path, *texts: str, event: str = "tried") -> None:
    log = AuditLog("web", where, "1")
    for text in texts:
        log.note(event, text)
    log.close()


def test_entries_are_kept_in_order_and_closed_to_others(tmp_path: Path) -> None:
    where = tmp_path / "keyhole" / "audit"
    written(where, "first", "second\nline \u2028 and é", event="tried")
    (path,) = places.files(where)
    assert path.name == datetime.now(UTC).strftime("%Y-%m-%d.jsonl")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(where.stat().st_mode) == 0o700
    lines = [json.loads(line) for line in path.read_bytes().splitlines()]
    assert [line["text"] for line in lines] == ["first", "second line and é"]
    assert lines == newest(where, 10)
    assert lines[0]["source"] == "web"
    assert lines[0]["pid"] == os.getpid()
    assert datetime.fromisoformat(lines[0]["time"]).tzinfo is not None


def test_several_writers_share_a_file_line_by_line(tmp_path: Path) -> None:
    logs = [AuditLog(source, tmp_path) for source in ("supervisor", "web", "recorder")]

    def fill(log: AuditLog) -> None:
        for number in range(200):
            log.note("tried", "x" * (number % 300), number=number)

    threads = [threading.Thread(target=fill, args=(log,)) for log in logs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for log in logs:
        log.close(30.0)
    found = newest(tmp_path, 1000)
    assert len(found) == 600
    for source in ("supervisor", "web", "recorder"):
        numbers = [entry["number"] for entry in found if entry["source"] == source]
        assert numbers == list(range(200))


def test_what_is_no_json_and_what_is_too_long_is_made_fit(tmp_path: Path) -> None:
    log = AuditLog("web", tmp_path)
    data: dict[str, Any] = {"path": Path("a"), "number": float("inf"), "none": None}
    log.note("tried", "z" * 100_000, **data, text_too="y" * 100_000)
    log.note("tried", "many", parts=[["w" * 1000] * 100] * 100)
    log.close()
    first, second = newest(tmp_path, 10)
    assert first["path"] == "a"
    assert first["number"] == "inf"
    assert "none" not in first
    assert second["cut"]
    assert all(len(json.dumps(entry)) < 4096 for entry in (first, second))


def test_the_newest_are_found_by_count_time_and_kind(tmp_path: Path) -> None:
    log = AuditLog("web", tmp_path)
    for number in range(50):
        log.note("odd" if number % 2 else "even", str(number), filler="f" * 3000)
    log.close()
    entries = newest(tmp_path, 1000)
    assert [entry["text"] for entry in entries] == [str(number) for number in range(50)]
    assert [entry["text"] for entry in newest(tmp_path, 3)] == ["47", "48", "49"]
    assert [entry["text"] for entry in newest(tmp_path, 2, event="even")] == ["46", "48"]
    middle = datetime.fromisoformat(entries[20]["time"])
    later = [entry for entry in entries if datetime.fromisoformat(entry["time"]) > middle]
    assert newest(tmp_path, 1000, middle) == later


def test_damaged_lines_and_foreign_files_are_left_alone(tmp_path: Path) -> None:
    written(tmp_path, "whole")
    (path,) = places.files(tmp_path)
    with path.open("ab") as file:
        file.write(b'{"event": "torn", "te\n[1]\n{}\n\xff\xfe\n{"event": 1}\n')
        file.write(b'{"event": "no zone", "time": "2026-01-01"}\n')
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "2026-13-45x.jsonl").write_text("mine")
    assert [entry["text"] for entry in newest(tmp_path, 10)] == ["whole"]
    assert newest(tmp_path / "missing", 10) == []


def test_a_day_goes_on_in_a_further_file_and_the_oldest_leaves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(places, "LARGEST_FILE", 2_000)
    monkeypatch.setattr(places, "LARGEST_FOLDER", 12_000)
    log = AuditLog("web", tmp_path)
    for number in range(200):
        log.note("tried", str(number), filler="f" * 200)
    log.close(30.0)
    files = places.files(tmp_path)
    assert 3 <= len(files) <= 7
    assert sum(path.stat().st_size for path in files) < 12_000 + 2_000
    kept = [int(entry["text"]) for entry in newest(tmp_path, 1000)]
    assert kept == list(range(kept[0], 200))


def test_the_file_is_that_of_the_day(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = AuditLog("web", tmp_path)
    for day in ("2026-01-31", "2026-02-01", "2026-01-31"):
        moment = datetime.fromisoformat(f"{day}T12:00:00+00:00").timestamp()
        monkeypatch.setattr(time, "time_ns", lambda moment=moment: int(moment * 1e9))
        log.note("tried", day)
    monkeypatch.undo()
    log.close()
    assert [path.name for path in places.files(tmp_path)] == [
        "2026-01-31.jsonl", "2026-02-01.jsonl",
    ]  # fmt: skip
    assert len((tmp_path / "2026-01-31.jsonl").read_text().splitlines()) == 2


def test_a_disk_that_fails_stops_nobody_and_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    where = tmp_path / "audit"
    where.write_text("a file stands where the folder should be")
    log = AuditLog("web", where)
    for number in range(20):
        log.note("tried", str(number))
    eventually(lambda: log.trouble, "the trouble is told")
    assert "cannot be written" in caplog.text
    eventually(log._waiting.empty, "all were tried")
    where.unlink()
    log.note("tried", "again")
    log.close()
    lost, again = newest(where, 10)
    assert lost["event"] == "audit_lost"
    assert lost["text"].startswith("20 entries")
    assert again["text"] == "again"
    assert log.trouble == ""


def test_a_log_without_a_folder_keeps_nothing() -> None:
    log = AuditLog("web", None)
    log.note("tried", "nothing")
    log.close()


def test_of_many_alike_the_first_passes_and_the_rest_is_counted() -> None:
    now = [0.0]
    throttle = Throttle(5.0, most=3, clock=lambda: now[0])
    assert throttle.passes("a") == 0
    assert [throttle.passes("a") for _ in range(4)] == [None] * 4
    assert throttle.passes("b") == 0
    now[0] = 5.0
    assert throttle.passes("a") == 4
    for kind in range(1000):
        throttle.passes(kind)
    assert len(throttle._seen) == 3


def test_the_folder_is_where_the_system_keeps_state(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/somewhere")
    assert places.folder() == Path("/somewhere/keyhole/audit")
    monkeypatch.setenv("XDG_STATE_HOME", "relative")
    assert places.folder() == Path.home() / ".local/state/keyhole/audit"
