"""The other end of the control channel, and the simulator as a process of its own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

import msgspec

from hardware.fake_servos.program import control_path
from robot.errors import KeyholeError

_ANSWER_S = 10.0
_START_S = 60.0
_END_S = 5.0


class FakeServosFailed(KeyholeError):
    """The simulator refused a request, did not start, or is gone."""

    code = "fake_servos"


class FakeServos:
    """A running simulator.

    Args:
        link: the name of its port.
    """

    def __init__(self, link: Path | str) -> None:
        self.link = Path(link)
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(_ANSWER_S)
        try:
            self._socket.connect(str(control_path(self.link)))
        except OSError as error:
            raise FakeServosFailed(f"{control_path(self.link)}: {error.strerror}") from None
        self._received = b""

    def ask(self, **request: Any) -> dict[str, Any]:
        """Send one request; see ``program.py`` for what there is.

        Raises:
            FakeServosFailed: it was refused, or nobody answers.
        """
        try:
            self._socket.sendall(msgspec.json.encode(request) + b"\n")
            while b"\n" not in self._received:
                data = self._socket.recv(1 << 20)
                if not data:
                    raise FakeServosFailed(f"{self.link}: the simulator is gone")
                self._received += data
        except OSError as error:
            raise FakeServosFailed(f"{self.link}: {error}") from None
        line, _, self._received = self._received.partition(b"\n")
        answer: dict[str, Any] = msgspec.json.decode(line)
        if not answer["ok"]:
            raise FakeServosFailed(f"{answer['code']}: {answer['message']}")
        return answer

    def inject(self, name: str, **options: float) -> int:
        """Inject a fault; the monotonic time in ns at which that was done."""
        return int(self.ask(inject=name, **options)["stamp_ns"])

    def clear(self, name: str | None = None) -> int:
        """End one kind of fault, or all; when that was done."""
        return int(self.ask(clear=name or True)["stamp_ns"])

    def state(self) -> dict[str, Any]:
        """Servos, segment, faults, CPU time."""
        return self.ask(state=True)

    def goals(self, since_ns: int = 0, rows: int = 5000) -> list[Any]:
        """Goals written: ``[received_ns, executed_ns, [[id, ticks], ...]]`` each."""
        return list(self.ask(goals=True, since_ns=since_ns, rows=rows)["goals"])

    def positions(self, since_ns: int = 0, rows: int = 5000) -> list[Any]:
        """True motion: ``[stamp_ns, [ticks, ...], [u, v]]`` each, changes only."""
        return list(self.ask(positions=True, since_ns=since_ns, rows=rows)["positions"])

    def unplug(self) -> int:
        """Pull the port out; when that was done."""
        return int(self.ask(unplug=True)["stamp_ns"])

    def replug(self, name: str | None = None) -> int:
        """Plug it in again, under another name beside the first one if wanted; when."""
        return int(self.ask(replug=name or True)["stamp_ns"])

    def close(self) -> None:
        """End the conversation; the simulator goes on."""
        self._socket.close()


class FakeServosProcess:
    """A simulator that lives as long as a ``with`` block.

    Args:
        link: name of its port.
        arguments: further ones of ``keyhole fake-servos``.

    Attributes:
        servos: its control channel.
        pid: its process.
    """

    def __init__(self, link: Path | str, *arguments: str) -> None:
        self.link = Path(link)
        self._arguments = arguments

    def __enter__(self) -> FakeServosProcess:
        command = [sys.executable, "-m", "server.command_line", "fake-servos"]
        # Modules are found where this one was, wherever the caller stands.
        path = os.pathsep.join(filter(None, [*sys.path]))
        self._process = subprocess.Popen(
            [*command, "--link", str(self.link), *self._arguments],
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": path},
            text=True,
        )
        self.pid = self._process.pid
        begin = time.monotonic()
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line or time.monotonic() - begin > _START_S:
            self._end()
            raise FakeServosFailed(f"{self.link}: the simulator did not start")
        self.servos = FakeServos(self.link)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.servos.close()
        self._end()

    def _end(self) -> None:
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
