"""One child of the supervisor: started anew when it ends, later each time it ends soon."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

_SETTLED_S = 30.0
_LONGEST_PAUSE_S = 10.0


def describe_exit(status: int) -> str:
    """How a process ended, in words; ``status`` as :mod:`subprocess` gives it."""
    if status >= 0:
        return f"exit status {status}"
    with contextlib.suppress(ValueError):
        return f"signal {signal.Signals(-status).name}"
    return f"signal {-status}"


class ChildProcess:
    """A Python module that runs as a process of its own, in a session of its own.

    It is started as a new interpreter, never forked, and does not get the terminal's signals:
    the supervisor decides in which order processes end.

    Args:
        title: for messages.
        module: started with ``python -m``.
        arguments: of the module.
        descriptors: file descriptors that the child inherits.
        pause_s: how long to wait before it is started again, at first.

    Attributes:
        restarts: how often it was started again.
        started_ns: when it was started last, on the monotonic clock.
    """

    def __init__(
        self,
        title: str,
        module: str,
        arguments: Sequence[str],
        descriptors: Sequence[int],
        pause_s: float,
    ) -> None:
        self.title = title
        self.restarts = 0
        self._command = module_command(module, arguments)
        self._descriptors = tuple(descriptors)
        self._first_pause_s = self._pause_s = pause_s
        self._process: subprocess.Popen[bytes] | None = None
        self.started_ns = 0
        self._due: float | None = None

    @property
    def pid(self) -> int:
        """Process id; 0 while it does not run."""
        return 0 if self._process is None else self._process.pid

    def start(self) -> None:
        """Start it."""
        self.started_ns = time.monotonic_ns()
        self._due = None
        self._process = subprocess.Popen(
            self._command,
            pass_fds=self._descriptors,
            stdin=subprocess.DEVNULL,
            env=module_environment(),
            start_new_session=True,
        )

    def ended(self) -> int | None:
        """Its exit status, once, when it has ended; a restart is then due after a pause."""
        if self._process is None:
            return None
        status = self._process.poll()
        if status is None:
            return None
        self._process = None
        now = time.monotonic()
        if now - self.started_ns * 1e-9 > _SETTLED_S:
            self._pause_s = self._first_pause_s
        self._due = now + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, _LONGEST_PAUSE_S)
        return status

    def restart_if_due(self) -> bool:
        """Start it again when its pause is over; tells whether it did."""
        if self._due is None or time.monotonic() < self._due:
            return False
        self.restarts += 1
        self.start()
        return True

    def kill(self) -> None:
        """End it by force."""
        if self._process is not None:
            self._process.kill()

    def finish(self, patience_s: float) -> bool:
        """Ask it to end, by force if it does not; tells whether it ended by itself."""
        process, self._due = self._process, None
        self._process = None
        if process is None:
            return True
        process.terminate()
        try:
            process.wait(patience_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            return False
        return True


def module_command(module: str, arguments: Sequence[str]) -> list[str]:
    """Command that runs a module of ours with this interpreter.

    ``-P`` keeps the folder in which the console was started off the path: a folder called
    ``robot`` in it must not take the place of ours.
    """
    return [sys.executable, "-P", "-m", module, *arguments]


def module_environment() -> dict[str, str]:
    """The environment for it: this one, and where to find us if we are not installed."""
    environment = dict(os.environ)
    root = Path(__file__).resolve().parents[2]
    if (root / "pyproject.toml").exists():
        known = environment.get("PYTHONPATH")
        environment["PYTHONPATH"] = f"{root}{os.pathsep}{known}" if known else str(root)
    return environment
