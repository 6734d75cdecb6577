"""A fake stylus that runs in a thread, and whoever asks its control channel."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from server.fake_stylus.device import FakeStylus, Place
from server.fake_stylus.outlets import RosbridgeServer
from server.fake_stylus.program import RATE_HZ, Options, Program
from server.fake_stylus.wording import RosWording

POSES, BUTTONS, FORCES, SERVOS = "/stylus/pose", "/stylus/buttons", "/stylus/force", "/servos"


def line_places(length_m: float, seconds: float) -> list[Place]:
    """To and fro along x."""
    count = round(seconds * RATE_HZ)
    way = [length_m * (1.0 - abs(2.0 * step / count - 1.0)) for step in range(count + 1)]
    return [(x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0) for x in way]


class RunningStylus:
    """A rosbridge with a fake stylus, in a thread.

    Args:
        folder: for the control channel.
        repeats_buttons: whether buttons are told again and again.
    """

    def __init__(self, folder: Path, *, repeats_buttons: bool = True) -> None:
        self._control = folder / "stylus.control"
        self.server = RosbridgeServer("ws://127.0.0.1:0", RosWording(POSES, BUTTONS))
        stylus = FakeStylus(line_places(0.02, 4.0), RATE_HZ, 1, automatic=False)
        options = Options(self._control, repeats_buttons=repeats_buttons, realtime=False)
        self._ending = threading.Event()
        self._program = Program(stylus, self.server, options)
        self._thread = threading.Thread(target=self._program.run, args=(self._ending.is_set,))
        self._thread.start()

    def ask(self, **request: Any) -> Any:
        """Send one request to the control channel."""
        with socket.socket(socket.AF_UNIX) as channel:
            channel.settimeout(10.0)
            channel.connect(str(self._control))
            channel.sendall(msgspec.json.encode(request) + b"\n")
            answer = b""
            while not answer.endswith(b"\n"):
                answer += channel.recv(1 << 20)
        return msgspec.json.decode(answer)

    def end(self) -> None:
        self._ending.set()
        self._thread.join(10.0)
        assert not self._thread.is_alive()


@pytest.fixture
def fake(tmp_path: Path) -> Iterator[RunningStylus]:
    running = RunningStylus(tmp_path)
    yield running
    running.end()
