"""Reads the audit log: the newest entries, for the API, the page and whoever goes on writing."""

from __future__ import annotations

import json
import os
from datetime import datetime
from pathlib import Path
from typing import Any

from server.audit import folder as places

MOST = 1000
"""Entries that one reading gives at most."""

_BLOCK = 65_536


def newest(
    where: Path, last: int, since: datetime | None = None, event: str | None = None
) -> list[dict[str, Any]]:
    """The last entries, the oldest of them first. Reads files: an event loop leaves it to a thread.

    Args:
        where: the folder.
        last: at most so many, and at most :data:`MOST`.
        since: only entries after this time, with its time zone.
        event: only entries of this kind.

    Returns:
        The entries as they were written. Lines that are damaged are left out.
    """
    found: list[dict[str, Any]] = []
    wanted = min(last, MOST)
    for path in reversed(places.files(where)):
        for line in _backwards(path):
            entry = _parsed(line)
            if entry is None or (event is not None and entry["event"] != event):
                continue
            if since is not None and _moment(entry) <= since:
                return found[::-1]
            found.append(entry)
            if len(found) >= wanted:
                return found[::-1]
    return found[::-1]


def _moment(entry: dict[str, Any]) -> datetime:
    return datetime.fromisoformat(entry["time"])


def _backwards(path: Path) -> Any:
    """Lines of a file, the last one first."""
    try:
        with path.open("rb") as file:
            end = file.seek(0, os.SEEK_END)
            rest = b""
            while end > 0:
                start = max(0, end - _BLOCK)
                file.seek(start)
                lines = (file.read(end - start) + rest).split(b"\n")
                rest, end = lines[0], start
                yield from (line for line in reversed(lines[1:]) if line)
            if rest:
                yield rest
    except OSError:
        return


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        entry = json.loads(line)
        if not isinstance(entry, dict) or not isinstance(entry["event"], str):
            return None
        if _moment(entry).tzinfo is None:
            return None
    except (ValueError, KeyError, TypeError):
        return None
    return entry
