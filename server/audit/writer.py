"""Appends to the audit log without ever making its caller wait for a disk.

Every process of a console but control has one writer. Lines are appended whole by O_APPEND, so that
several processes share a file; control itself writes nothing: what it does stands in its records.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import queue
import threading
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from robot.errors import KeyholeError
from server.audit import folder as places
from server.memory.run_directory import RunDirectory

LONGEST_LINE = 4096
MOST_WAITING = 2000
"""Entries that may wait for the disk; further ones are counted and dropped."""

_LONGEST_TEXT = 400
_MOST_VALUES = 40

_log = logging.getLogger("keyhole.audit")


class _Entry(NamedTuple):
    time_ns: int
    monotonic_ns: int
    event: str
    text: str
    data: dict[str, Any]


def _short(value: object) -> Any:
    """``value`` in a form that JSON has, and of a bounded length."""
    match value:
        case None | bool() | int():
            return value
        case float():
            return value if abs(value) < float("inf") else str(value)
        case list() | tuple():
            return [_short(part) for part in value[:_MOST_VALUES]]
        case dict():
            return {str(key)[:80]: _short(part) for key, part in list(value.items())[:_MOST_VALUES]}
        case _:
            return str(value)[:_LONGEST_TEXT]


class AuditLog:
    """The writer of one process. Its methods may be called from any thread.

    Args:
        source: which process writes: supervisor, web, recorder, stop.
        where: the folder; None keeps nothing.
        run: identity of the console, the same in all its processes.

    Attributes:
        where: as given.
        run: as given.
        trouble: why the last entry could not be written, empty when it was.
    """

    def __init__(self, source: str, where: Path | None, run: str = "") -> None:
        self._source, self.where, self.run = source, where, run
        self._waiting: queue.Queue[_Entry | None] = queue.Queue(MOST_WAITING)
        self._dropped = 0
        self._descriptor: int | None = None
        self._day, self._part, self._torn = "", 1, False
        self.trouble = ""
        self._thread: threading.Thread | None = None
        if where is not None:
            self._thread = threading.Thread(target=self._run_writer, name="audit", daemon=True)
            self._thread.start()

    @classmethod
    def of_console(cls, source: str, directory: Path) -> AuditLog:
        """The writer of a process that belongs to the console in that run directory."""
        run = ""
        with contextlib.suppress(KeyholeError, ValueError):
            run = str(RunDirectory(directory).console().get("started_ns", ""))
        return cls(source, places.folder(), run)

    def note(self, event: str, text: str, **data: object) -> None:
        """Append an entry; returns at once, whatever the disk does.

        Args:
            event: a stable word for programs.
            text: one sentence for people.
            data: what else there is to know.
        """
        if self.where is None:
            return
        entry = _Entry(time.time_ns(), time.monotonic_ns(), event, text, data)
        try:
            self._waiting.put_nowait(entry)
        except queue.Full:
            self._dropped += 1

    def close(self, patience_s: float = 2.0) -> None:
        """Write what waits, but wait no longer than ``patience_s`` for it."""
        if self._thread is None:
            return
        with contextlib.suppress(queue.Full):
            self._waiting.put(None, timeout=patience_s)
        self._thread.join(patience_s)
        self._thread = None

    def _run_writer(self) -> None:
        while (entry := self._waiting.get()) is not None:
            self._write(entry)
        self._shut()

    def _write(self, entry: _Entry) -> None:
        try:
            self._open_for(entry)
            if self._dropped:
                lost, self._dropped = self._dropped, 0
                words = f"{lost} entries before this one were lost: {self.trouble or 'too many'}"
                self._append(self._line(entry._replace(event="audit_lost", text=words, data={})))
            self._append(self._line(entry))
            self.trouble = ""
        except OSError as error:
            self._dropped += 1
            self._shut()
            if not self.trouble:
                _log.error("the audit log cannot be written: %s (%s)", error.strerror, self.where)
            self.trouble = error.strerror or "it cannot be written"

    def _line(self, entry: _Entry) -> bytes:
        moment = datetime.fromtimestamp(entry.time_ns * 1e-9, UTC)
        head = {
            "time": moment.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
            "monotonic_ns": entry.monotonic_ns,
            "source": self._source,
            "pid": os.getpid(),
            "run": self.run,
            "event": entry.event,
            "text": " ".join(entry.text.split())[:_LONGEST_TEXT],
        }
        more = {name: _short(value) for name, value in entry.data.items() if value is not None}
        line = json.dumps({**head, **more}).encode()
        return line if len(line) < LONGEST_LINE else json.dumps({**head, "cut": True}).encode()

    def _append(self, line: bytes) -> None:
        """One write for a whole line: lines of several processes do not mix."""
        assert self._descriptor is not None
        content = (b"\n" if self._torn else b"") + line + b"\n"
        written = os.write(self._descriptor, content)
        self._torn = written != len(content)
        if self._torn:
            raise OSError(28, "no space is left")

    def _open_for(self, entry: _Entry) -> None:
        """Have the file open that belongs to the entry's day and has room."""
        assert self.where is not None
        day = datetime.fromtimestamp(entry.time_ns * 1e-9, UTC).strftime("%Y-%m-%d")
        if day != self._day:
            self._shut()
            self._day, self._part = day, 1
        while True:
            if self._descriptor is None:
                self._descriptor = self._opened(self.where / places.file_of(day, self._part))
            if os.fstat(self._descriptor).st_size < places.LARGEST_FILE:
                return
            self._shut()
            self._part += 1

    def _opened(self, path: Path) -> int:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        descriptor = os.open(path, flags, 0o600)
        _remove_oldest(path.parent)
        return descriptor

    def _shut(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _remove_oldest(where: Path) -> None:
    """Keep the folder within its size."""
    known = places.files(where)
    with contextlib.suppress(OSError):
        sizes = [path.stat().st_size for path in known]
        while len(known) > 1 and sum(sizes) > places.LARGEST_FOLDER - places.LARGEST_FILE:
            known.pop(0).unlink()
            sizes.pop(0)
