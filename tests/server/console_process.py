"""A real console for tests: supervisor, control and web, on a free port."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from server.child_process import module_command, module_environment
from server.link import WebLink
from server.link_records import SUPERVISION, SUPERVISION_FILE
from server.mapped import MappedReadError, MappedSlot

ROBOT = "/api/v1/robots/instrument"
START_S = 90.0
"""The first start of a new version compiles the controller."""


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


class ConsoleProcess:
    """A console that runs for the length of a ``with`` block.

    Args:
        folder: where its run directory goes.
        arguments: more arguments of ``keyhole console``.
    """

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.directory = folder / "run"
        self._arguments = arguments
        self._errors = folder / "stderr.txt"

    def __enter__(self) -> Self:
        fixed = ["console", "--no-browser", "--port", "0", "--run-directory", str(self.directory)]
        with self._errors.open("wb") as errors:
            self.process = subprocess.Popen(
                command_line(*fixed, *self._arguments),
                stdout=subprocess.PIPE,
                stderr=errors,
                env=module_environment(),
            )
        assert self.process.stdout is not None
        line = self.process.stdout.readline().decode()
        found = re.search(r"(http://\S+/)\?token=(\S+)", line)
        if found is None:
            self.process.wait()
            raise AssertionError(f"no address: {line!r} {self.errors()}")
        self.base, self.token = found[1].rstrip("/"), found[2]
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(15.0)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def errors(self) -> str:
        """What it wrote to stderr so far."""
        return self._errors.read_text()

    def call(self, method: str, path: str, body: Any = None, **headers: str) -> Any:
        """Call the API with the token; returns the parsed answer."""
        content = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            self.base + path,
            method=method,
            data=content,
            headers={
                "Authorization": f"Bearer {self.token}",
                "Content-Type": "application/json",
                **{name.replace("_", "-"): value for name, value in headers.items()},
            },
        )
        with urllib.request.urlopen(request, timeout=10.0) as answer:
            return json.load(answer)

    def state(self) -> dict[str, Any]:
        """The state message; empty while the web process does not answer."""
        with contextlib.suppress(OSError):
            found = self.call("GET", f"{ROBOT}/state")
            assert isinstance(found, dict)
            return found
        return {}

    def wait_until_running(self) -> dict[str, Any]:
        """Wait for control and web; returns the state message."""

        def running() -> dict[str, Any]:
            if self.process.poll() is not None:
                raise AssertionError(f"the console ended: {self.errors()}")
            state = self.state()
            return state if state.get("control") == "running" else {}

        found = eventually(running, "control runs", START_S)
        assert isinstance(found, dict)
        return found

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
