"""The fake stylus speaks as a rosbridge does, to anyone who does."""

from __future__ import annotations

import json
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect

from server.leaders import rosbridge
from server.supervision.child_process import module_environment
from tests.server.console_process import command_line, eventually
from tests.server.fake_stylus.conftest import BUTTONS, FORCES, POSES, RunningStylus

JSON = dict[str, Any]


def newest(client: Any, topic: str) -> JSON:
    """The next message of a topic."""
    while True:
        message = json.loads(client.recv(timeout=5.0))
        if message.get("topic") == topic:
            found = message["msg"]
            assert isinstance(found, dict)
            return found


def test_a_client_of_any_make_gets_what_it_subscribes(fake: RunningStylus) -> None:
    with connect(fake.server.address, compression=None, proxy=None) as client:
        client.send(rosbridge.subscribe(POSES, rosbridge.POSE_TYPE).decode())
        first = newest(client, POSES)
        later = [newest(client, POSES) for _ in range(50)]
        stamps = [
            m["header"]["stamp"]["sec"] * 10**9 + m["header"]["stamp"]["nanosec"] for m in later
        ]
        assert stamps == sorted(set(stamps))
        assert 0 < time.monotonic_ns() - stamps[-1] < 5 * 10**9
        assert [m["header"]["seq"] for m in later] == sorted({m["header"]["seq"] for m in later})
        assert first["pose"]["orientation"] == {"x": 0, "y": 0, "z": 0, "w": 1}
        sent = dict(fake.ask(sent=True)["sent"])
        assert {
            m["header"]["seq"]: stamp for m, stamp in zip(later, stamps, strict=True)
        }.items() <= (sent.items())
        client.send(rosbridge.subscribe(BUTTONS, rosbridge.BUTTONS_TYPE).decode())
        assert newest(client, BUTTONS)["buttons"] == [0, 0]
        assert fake.ask(press=2)["buttons"] == 2
        eventually(lambda: newest(client, BUTTONS)["buttons"] == [0, 1], "the second button")


def test_forces_come_back(fake: RunningStylus) -> None:
    with connect(fake.server.address, compression=None, proxy=None) as client:
        client.send(rosbridge.advertise(FORCES, rosbridge.FORCE_TYPE).decode())
        client.send(rosbridge.publish_force(FORCES, (0.1, 0.2, -0.3), 5).decode())
        state = eventually(lambda: fake.ask(state=True)["force_n"] != [0, 0, 0], "the force")
        assert state
        assert fake.ask(forces=True)["forces"][-1][1:] == [0.1, 0.2, -0.3]


def test_nonsense_is_answered_and_harmless(fake: RunningStylus) -> None:
    with connect(fake.server.address, compression=None, proxy=None) as client:
        client.send("nonsense")
        assert json.loads(client.recv(timeout=5.0))["op"] == "status"
        client.send(json.dumps({"op": "fly"}))
        assert "fly" in json.loads(client.recv(timeout=5.0))["msg"]
    assert fake.ask(dance=True)["ok"] is False
    assert fake.ask(inject="dance")["code"] == "unknown_name"
    assert fake.ask(press=7)["ok"] is False
    assert fake.ask(state=True)["ok"] is True


def test_a_drop_out_breaks_the_connection_for_its_time(fake: RunningStylus) -> None:
    with connect(fake.server.address, compression=None, proxy=None):
        eventually(lambda: fake.ask(state=True)["clients"] == 1, "connected")
        before = time.monotonic_ns()
        answer = fake.ask(inject="drop-out", delay_ms=300)
        assert before <= answer["stamp_ns"] <= time.monotonic_ns()
        eventually(lambda: fake.ask(state=True)["clients"] == 0, "dropped")
    with connect(fake.server.address, compression=None, proxy=None, open_timeout=10.0):
        eventually(lambda: fake.ask(state=True)["clients"] == 1, "connected again")


def test_the_command_plays_until_it_is_asked_to_end(tmp_path: Path) -> None:
    control = tmp_path / "control"
    arguments = ("fake-stylus", "--listen", "ws://127.0.0.1:0", "--control", str(control))
    with subprocess.Popen(
        command_line(*arguments), stdout=subprocess.PIPE, text=True, env=module_environment()
    ) as program:
        try:
            assert program.stdout is not None
            words = program.stdout.readline()
            assert "ws://127.0.0.1:" in words
            assert str(control) in words
            program.terminate()
            assert program.wait(20.0) == 0
        finally:
            program.kill()
    assert not control.exists()


@pytest.mark.parametrize("options", [("--faults", "dance"), ("--path", "nowhere"), ("--to", "x:y")])
def test_the_command_refuses_what_makes_no_sense(tmp_path: Path, options: tuple[str, str]) -> None:
    from server.command_line import main

    if options[0] == "--to":
        options = ("--to", "http://127.0.0.1:1")
        extra: tuple[str, ...] = ("--operator", "Ada", "--token", "x")
    else:
        extra = ("--listen", "ws://127.0.0.1:0")
    assert main(["fake-stylus", *options, *extra, "--control", str(tmp_path / "c")]) == 2
