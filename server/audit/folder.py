"""Where the audit log is kept: one file of JSON lines for each day, in UTC."""

from __future__ import annotations

import os
import re
from pathlib import Path

LARGEST_FILE = 8_000_000
"""Bytes; a day goes on in a further file beyond it."""
LARGEST_FOLDER = 64_000_000
"""Bytes; the oldest files are removed beyond it."""

_NAME = re.compile(r"(\d{4}-\d{2}-\d{2})(?:\.(\d{1,4}))?\.jsonl")


def folder() -> Path:
    """The folder of this user's audit log; it need not exist yet."""
    state = os.environ.get("XDG_STATE_HOME", "")
    parent = Path(state) if os.path.isabs(state) else Path.home() / ".local" / "state"
    return parent / "keyhole" / "audit"


def file_of(day: str, part: int) -> str:
    """Name of the part (from 1) of a day's log; ``day`` as in 2026-01-31."""
    return f"{day}.jsonl" if part == 1 else f"{day}.{part}.jsonl"


def files(where: Path) -> list[Path]:
    """The files of the log in ``where``, the oldest first; what is not one is left alone."""
    try:
        names = [entry.name for entry in os.scandir(where) if entry.is_file()]
    except OSError:
        return []
    found = [(match[1], int(match[2] or 1), match[0]) for name in names if (match := _full(name))]
    return [where / name for _, _, name in sorted(found)]


def _full(name: str) -> re.Match[str] | None:
    return _NAME.fullmatch(name)
