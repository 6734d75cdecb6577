"""A real console for tests: supervisor, control and web, on a free port."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from benchmarks.console import Console
from server.memory.link import WebLink
from server.memory.link_records import SUPERVISION, SUPERVISION_FILE
from server.memory.mapped import MappedReadError, MappedSlot
from server.supervision.child_process import module_command


def command_line(*arguments: str) -> list[str]:
    """The ``keyhole`` command with ``arguments``, run by this interpreter."""
    return module_command("server.command_line", arguments)


def eventually(
    condition: Callable[[], Any], what: str, within_s: float = 15.0, every_s: float = 0.02
) -> Any:
    """The first true value of ``condition``; fails the test when there is none in time."""
    ends = time.monotonic() + within_s
    while time.monotonic() < ends:
        found = condition()
        if found:
            return found
        time.sleep(every_s)
    raise AssertionError(f"not within {within_s:g} s: {what}")


class ConsoleProcess(Console):
    """A console that runs for the length of a ``with`` block.

    Args:
        folder: where its run directory goes.
        arguments: more arguments of the command.
        command: it, and what stands before its options.

        terminal: descriptor of the terminal in which it runs; None for none.

    Attributes:
        recordings: its folder of recordings.
        audit: its folder of audit logs.
    """

    def __init__(
        self,
        folder: Path,
        *arguments: str,
        command: tuple[str, ...] = ("console",),
        terminal: int | None = None,
        robot: str = "instrument",
    ) -> None:
        self.audit = folder / "state" / "keyhole" / "audit"
        data = folder / "data"
        self.recordings = data / "keyhole" / "recordings"
        super().__init__(
            folder / "run",
            arguments=arguments,
            command=command,
            environment={"XDG_DATA_HOME": str(data), "XDG_STATE_HOME": str(folder / "state")},
            terminal=terminal,
            robot=robot,
        )

    def children(self) -> tuple[int, int]:
        """Process ids of control and web; 0 for one that is down or not yet up."""
        try:
            told = MappedSlot(self.directory / SUPERVISION_FILE, SUPERVISION).read()[0]
        except MappedReadError:
            return 0, 0
        return int(told["control_pid"]), int(told["web_pid"])

    @contextlib.contextmanager
    def link(self) -> Iterator[WebLink]:
        """The web side of the link, for a console whose web process is not used."""
        link = WebLink(self.directory)
        try:
            yield link
        finally:
            link.close()


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that ended and was not waited for does not."""
    try:
        os.kill(pid, 0)
        status = (Path("/proc") / str(pid) / "status").read_text()
    except ProcessLookupError:
        return False
    except FileNotFoundError:
        return not Path("/proc").is_dir()
    return "State:\tZ" not in status
