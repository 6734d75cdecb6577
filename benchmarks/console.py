"""A real console as a process, driven through its API, and helper processes beside it."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from robot.errors import KeyholeError
from robot.records import RECORD
from server.memory.link_records import RECORD_RING_FILE
from server.memory.mapped import MappedRing
from server.supervision.child_process import module_command, module_environment

START_S = 120.0
"""The first start of a new version compiles the controller."""

_END_S = 15.0
_KEEP_S = 0.5


class ConsoleFailed(KeyholeError):
    """The console did not start, or did not answer as it should."""

    code = "console_failed"


class Console:
    """A console on a free port that runs for the length of a ``with`` block.

    Args:
        directory: its run directory.
        config: configuration file; None for the default.
        arguments: more arguments of the command.
        command: it, and what stands before its options.
        environment: variables beside those of this process.
        terminal: descriptor of the terminal in which it runs; None for none.
        robot: which robot it drives, as the arguments choose it.

    Attributes:
        robot_path: where the API has that robot.
        process: the supervisor.
        base: its address, without a slash at the end.
        token: its token.
    """

    def __init__(
        self,
        directory: Path,
        config: str | None = None,
        arguments: tuple[str, ...] = (),
        *,
        command: tuple[str, ...] = ("console",),
        environment: dict[str, str] | None = None,
        terminal: int | None = None,
        robot: str = "instrument",
    ) -> None:
        self.directory = directory
        self.robot_path = f"/api/v1/robots/{robot}"
        # What is measured and tested has no place in the audit log of the robots.
        state = {"XDG_STATE_HOME": str(directory.with_name(f"{directory.name}.state"))}
        self._command, self._environment = command, {**state, **(environment or {})}
        options = ["--config", config] if config else []
        self._arguments = [*options, *arguments]
        self._errors = directory.with_name(f"{directory.name}.stderr")
        self._lease = self._trouble = ""
        self._terminal = subprocess.DEVNULL if terminal is None else terminal

    def __enter__(self) -> Self:
        place = ["--run-directory", str(self.directory)]
        fixed = [*self._command, "--no-browser", "--port", "0", *place]
        with self._errors.open("wb") as errors:
            self.process = subprocess.Popen(
                module_command("server.command_line", [*fixed, *self._arguments]),
                stdin=self._terminal,
                stdout=subprocess.PIPE,
                stderr=errors,
                env={**module_environment(), **self._environment},
            )
        assert self.process.stdout is not None
        line = self.process.stdout.readline().decode()
        found = re.search(r"(http://\S+)/\?token=(\S+)", line)
        if found is None:
            self.process.wait()
            raise ConsoleFailed(f"the console did not start: {self.errors()}")
        self.base, self.token = found[1], found[2]
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
                self.process.wait(_END_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def errors(self) -> str:
        """What it wrote to stderr so far."""
        return self._errors.read_text()

    def call(self, method: str, path: str, body: Any = None) -> Any:
        """Call the API with the token, as the operator if we are; returns the parsed answer."""
        headers = {"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"}
        if self._lease:
            headers["X-Keyhole-Lease"] = self._lease
        content = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            self.base + path, method=method, data=content, headers=headers
        )
        with urllib.request.urlopen(request, timeout=10.0) as answer:
            return json.load(answer)

    def state(self) -> dict[str, Any]:
        """The state message; empty while the web process does not answer."""
        with contextlib.suppress(OSError):
            found = self.call("GET", f"{self.robot_path}/state")
            assert isinstance(found, dict)
            return found
        return {}

    def wait_until_running(self) -> dict[str, Any]:
        """Wait until control ticks and web answers; returns the state message."""
        ends = time.monotonic() + START_S
        while time.monotonic() < ends:
            if self.process.poll() is not None:
                raise ConsoleFailed(f"the console ended: {self.errors()}")
            state = self.state()
            if state.get("control") == "running":
                return state
            time.sleep(0.02)
        raise ConsoleFailed(f"control did not run within {START_S:g} s: {self.errors()}")

    def take_lease(self) -> None:
        """Become the operator."""
        self._lease = ""
        granted = self.call("POST", f"{self.robot_path}/lease", {"operator": "benchmark"})
        self._lease = str(granted["lease_id"])

    def enable(self) -> None:
        """Enable; takes the lease if we do not hold it."""
        self.wait_until_running()
        if not self._lease:
            self.take_lease()
        state = self.call("POST", f"{self.robot_path}/enable")
        if state["safety"]["state"] != "ENABLED":
            raise ConsoleFailed(f"the robot is not enabled: {state['safety']}")

    @contextlib.contextmanager
    def driving(self) -> Iterator[None]:
        """Enable, keep the lease, and keep a path playing for the length of the block."""
        self.enable()
        over = threading.Event()

        def drive() -> None:
            while not over.wait(_KEEP_S):
                try:
                    self._go_on()
                except (OSError, KeyholeError) as error:
                    self._trouble = str(error)
                    return

        thread = threading.Thread(target=drive)
        self._go_on()
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def _go_on(self) -> None:
        self.call("POST", f"{self.robot_path}/lease/renew")
        state = self.state()
        if state["safety"]["state"] != "ENABLED":
            raise ConsoleFailed(f"the robot stopped during the measurement: {state['safety']}")
        if state["path"] is None:
            self.call("POST", f"{self.robot_path}/path", {"experiment": "circle"})

    def drive_on(self, seconds: float) -> None:
        """Wait for so long; raises :class:`ConsoleFailed` if the robot did not go on."""
        time.sleep(seconds)
        if self._trouble:
            raise ConsoleFailed(self._trouble)

    def ring(self) -> MappedRing:
        """A reader of the records of the last seconds; the caller closes it."""
        return MappedRing(self.directory / RECORD_RING_FILE, RECORD)


class Helper:
    """A module that runs as a process for the length of a ``with`` block and speaks in lines.

    Args:
        module: started with ``python -m``.
        arguments: of the module.
    """

    def __init__(self, module: str, arguments: list[str]) -> None:
        self._module = module
        self._process = subprocess.Popen(
            module_command(module, arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=module_environment(),
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end_of_input()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def tell(self, line: str) -> None:
        """Send a line."""
        assert self._process.stdin is not None
        print(line, file=self._process.stdin, flush=True)

    def end_of_input(self) -> None:
        """Tell that nothing more comes."""
        assert self._process.stdin is not None
        self._process.stdin.close()

    def answer(self) -> Any:
        """The next line, parsed from JSON; waits for it."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise ConsoleFailed(f"{self._module} ended without an answer")
        return json.loads(line)
