"""A wall clock that can be set, for the processes of one console."""

from __future__ import annotations

import mmap
import os
import struct
from pathlib import Path

from server.supervision.child_process import module_environment

CLOCK_VARIABLE = "KEYHOLE_CLOCK_OFFSET"
_SITE = f'''"""The wall clock of this process is ahead by what stands in a file."""
import mmap, os, struct, time
_map = mmap.mmap(os.open(os.environ["{CLOCK_VARIABLE}"], os.O_RDONLY), 8, access=mmap.ACCESS_READ)
_time, _time_ns = time.time, time.time_ns
time.time = lambda: _time() + struct.unpack("d", _map)[0]
time.time_ns = lambda: _time_ns() + round(struct.unpack("d", _map)[0] * 1e9)
'''


class SettableClock:
    """The wall clock of a console's processes, which nobody may set on a shared machine.

    Only what these processes read is changed, not the clock itself.

    Args:
        folder: an empty one.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "sitecustomize.py").write_text(_SITE, encoding="utf-8")
        file = folder / "offset"
        file.write_bytes(struct.pack("d", 0.0))
        with file.open("r+b") as opened:
            self._map = mmap.mmap(opened.fileno(), 8)
        known = module_environment().get("PYTHONPATH", "")
        self.environment = {
            "PYTHONPATH": f"{folder}{os.pathsep}{known}",
            CLOCK_VARIABLE: str(file),
        }

    def set_ahead(self, seconds: float) -> None:
        """Put it so much ahead of the true one."""
        self._map[:] = struct.pack("d", seconds)
