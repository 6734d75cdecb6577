"""The fake arm as a program: faults by name and time, the control channel, the command."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from hardware.arm.address import REAL_PORT
from hardware.arm.reports import REAL
from hardware.control_channel import BadFault
from hardware.fake_arm.faults import FAULTS, Wanted, wanted_faults
from hardware.fake_arm.program import FakeArm
from robot.errors import UnknownName
from tests.hardware.fake_arm.rig import START, address, controller

ROOT = Path(__file__).resolve().parents[3]


class Channel:
    """The other end of the control channel."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(20.0)
        self._socket.connect(str(path))

    def ask(self, **request: Any) -> dict[str, Any]:
        self._socket.sendall(msgspec.json.encode(request) + b"\n")
        line = b""
        while not line.endswith(b"\n"):
            line += self._socket.recv(1 << 20)
        answer: dict[str, Any] = msgspec.json.decode(line)
        return answer

    def close(self) -> None:
        self._socket.close()


def reported() -> np.ndarray:
    """(7,) the joints of the next fast report."""
    with socket.create_connection((address().host, REAL_PORT), 5.0) as connection:
        data = b""
        while len(data) < REAL.itemsize:
            received = connection.recv(REAL.itemsize - len(data))
            assert received
            data += received
    found: np.ndarray = np.frombuffer(data, REAL)[0]["q"]
    return found


def test_faults_are_read_with_their_times() -> None:
    assert wanted_faults("") == []
    assert wanted_faults("collision, silent:after_ms=100:for_ms=50") == [
        Wanted("collision"),
        Wanted("silent", 100.0, 50.0),
    ]


@pytest.mark.parametrize("text", ["silent:soon", "silent:for_ms=x", "silent:for_ms=-1", "drop:x=1"])
def test_what_makes_no_sense_is_refused(text: str) -> None:
    with pytest.raises(BadFault):
        wanted_faults(text)
    with pytest.raises(UnknownName):
        wanted_faults("gremlins:for_ms=1")


def test_every_fault_is_documented() -> None:
    text = (ROOT / "docs" / "labs.md").read_text(encoding="utf-8")
    section = text.partition("## A simulated arm controller")[2].partition("\n## ")[0]
    assert [name for name in FAULTS if f"`{name}`" not in section] == []


def test_the_control_channel_breaks_mends_and_tells(tmp_path: Path) -> None:
    path = tmp_path / "arm.control"
    with FakeArm(controller(), address(), path):
        channel = Channel(path)
        before = time.monotonic_ns()
        answer = channel.ask(inject="emergency-stop")
        assert answer["ok"]
        assert before <= answer["stamp_ns"] <= time.monotonic_ns()
        state = channel.ask(state=True)
        assert (state["error"], state["faults"]) == (1, ["emergency-stop"])
        assert channel.ask(clear=True)["ok"]
        assert channel.ask(state=True)["faults"] == []
        assert channel.ask(goals=True)["goals"] == []
        refused = channel.ask(inject="gremlins")
        assert (refused["ok"], refused["code"]) == (False, "unknown_name")
        assert channel.ask(dance=True)["code"] == "bad_request"
        channel.close()
    assert not path.exists()


def test_a_planned_fault_comes_and_goes() -> None:
    plan = [Wanted("emergency-stop", 20.0, 200.0)]
    fake = FakeArm(controller(), address(), faults=plan)
    seen: list[bool] = []
    end = time.monotonic() + 20.0

    def over() -> bool:
        seen.append("emergency-stop" in fake.state()["faults"])
        return (True in seen and not seen[-1]) or time.monotonic() > end

    fake.run(over)
    fake.close()
    assert (seen[0], True in seen, seen[-1]) == (False, True, False)
    assert fake.controller.error == 1
    assert all(fault.meaning for fault in FAULTS.values())


def test_the_command_serves_until_it_is_told_to_stop(tmp_path: Path) -> None:
    path = tmp_path / "arm.control"
    command = [sys.executable, "-m", "server.command_line", "fake-arm", "--listen", str(address())]
    with subprocess.Popen(
        [*command, "--control", str(path)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            assert str(address()) in process.stdout.readline()
            channel = Channel(path)
            joints = channel.ask(state=True)["joints_rad"]
            np.testing.assert_allclose(reported(), joints, rtol=0, atol=1e-5)
            assert not np.allclose(joints, START)
            channel.close()
            process.send_signal(signal.SIGTERM)
            assert process.wait(20.0) == 0
        finally:
            process.kill()
    assert not path.exists()
