"""The simulated stylus as a process beside the console: small circles while it is held."""

from __future__ import annotations

import contextlib
import math
import re
import subprocess
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from hardware.fake_servos.client import FakeServos, FakeServosFailed
from hardware.fake_servos.program import control_path
from scenes.path_file import HEADER
from server.faults.demands import BenchFailed
from server.supervision.child_process import module_command, module_environment

_RADIUS_MM, _TURN_S, _ROWS = 8.0, 2.5, 50
_END_S = 5.0


def _circle() -> str:
    """One turn that ends where it begins, as a path file."""
    lines = [", ".join(HEADER)]
    for step in range(_ROWS + 1):
        angle = 2.0 * math.pi * step / _ROWS
        x, y = _RADIUS_MM * (math.cos(angle) - 1.0), _RADIUS_MM * math.sin(angle)
        lines.append(f"{_TURN_S * step / _ROWS:.4f}, {x:.6f}, {y:.6f}, 0, 1, 0, 0, 0")
    return "\n".join(lines) + "\n"


class StylusProcess:
    """A stylus behind a rosbridge that lives as long as a ``with`` block.

    Args:
        folder: for its path and its control channel.

    Attributes:
        address: of the rosbridge.
        channel: its control channel; speaks as that of the simulated servos does.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __enter__(self) -> Self:
        path, name = self._folder / "stylus.csv", self._folder / "stylus"
        path.write_text(_circle(), encoding="utf-8")
        arguments = ["fake-stylus", "--listen", "ws://127.0.0.1:0", "--manual"]
        arguments += ["--path", str(path), "--control", str(control_path(name))]
        self._process = subprocess.Popen(
            module_command("server.command_line", arguments),
            stdout=subprocess.PIPE,
            text=True,
            env=module_environment(),
        )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        found = re.search(r"ws://[^\s,]+", line)
        if found is None:
            self._end()
            raise BenchFailed(f"the simulated stylus did not start: {line.strip()}")
        self.address = found[0]
        try:
            self.channel = self._channel(name)
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.channel.close()
        self._end()

    @staticmethod
    def _channel(name: Path) -> FakeServos:
        """Its control channel, which it opens a little later than its port."""
        ends = time.monotonic() + _END_S
        while True:
            try:
                return FakeServos(name)
            except FakeServosFailed:
                if time.monotonic() > ends:
                    raise
                time.sleep(0.02)

    def _end(self) -> None:
        self._process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)
        self._process.kill()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
