"""Where recordings are kept, and how they are called."""

from __future__ import annotations

import os
import re
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from robot.errors import KeyholeError
from server.recording.errors import RecordingNotWritten

SUFFIX = ".mcap"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._ -]{0,99}")


class RecordingNameRefused(KeyholeError):
    """A recording cannot be called so.

    Attributes:
        name: the refused name.
    """

    code = "recording_name"

    def __init__(self, name: str) -> None:
        super().__init__(
            f"a recording cannot be called {name!r}; use letters, digits, spaces, dots, - and _, "
            "at most 100 and no folders"
        )
        self.name = name


class RecordingEntry(NamedTuple):
    """A file in the folder: name, bytes, and when it was written last (s since 1970)."""

    name: str
    size: int
    modified_s: float


def folder() -> Path:
    """The folder of this user's recordings; it need not exist yet."""
    data = os.environ.get("XDG_DATA_HOME", "")
    parent = Path(data) if os.path.isabs(data) else Path.home() / ".local" / "share"
    return parent / "keyhole" / "recordings"


def named(name: str | None = None) -> Path:
    """The path of a new recording in the folder.

    Args:
        name: its name, with or without ``.mcap``; None names it by the time.

    Raises:
        RecordingNameRefused: the name could lead elsewhere, or cannot be a file's.
    """
    if name is None:
        return following(folder() / (datetime.now().strftime("%Y-%m-%d_%H-%M-%S") + SUFFIX))
    if not _NAME.fullmatch(name):
        raise RecordingNameRefused(name)
    return folder() / (name if name.endswith(SUFFIX) else name + SUFFIX)


def following(path: Path) -> Path:
    """``path`` where it is free, else with the first free number behind its name."""
    number, free = 1, path
    while free.exists():
        number += 1
        free = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return free


def check_new(path: Path) -> Path:
    """``path``, where a new recording can be made.

    Raises:
        RecordingNotWritten: there is a file already, or none can be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        detail = f"its folder cannot be made: {error.strerror}; choose another"
        raise RecordingNotWritten(path, detail) from None
    if path.exists():
        raise RecordingNotWritten(path, "exists already; choose another name or move it away")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        detail = "cannot be made: its folder is not open to you for writing; choose another"
        raise RecordingNotWritten(path, detail)
    return path


def entries() -> list[RecordingEntry]:
    """The recordings in the folder, the newest first."""
    found = []
    try:
        for entry in os.scandir(folder()):
            if entry.name.endswith(SUFFIX) and entry.is_file():
                about = entry.stat()
                found.append(RecordingEntry(entry.name, about.st_size, about.st_mtime))
    except OSError:
        return []
    return sorted(found, key=lambda one: one.modified_s, reverse=True)
