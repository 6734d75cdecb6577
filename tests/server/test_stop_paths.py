"""The emergency stops that need no web process, and what the audit log tells of a console."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import subprocess
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.records import Safety
from server.audit.reader import newest
from server.commands.stop import NothingToStop, execute
from server.memory.link import WebLink
from server.memory.link_records import create_mapped_files
from server.memory.replay_link import create_replay_files
from server.supervision.child_process import module_environment
from server.supervision.terminal import Terminal
from tests.configured import LATE_TICKS, configured
from tests.server.console_process import ConsoleProcess, command_line, eventually


@pytest.fixture(scope="module")
def pty() -> Iterator[tuple[int, int]]:
    """Our end of a terminal, and the console's."""
    ours, theirs = os.openpty()
    yield ours, theirs
    os.close(ours)
    os.close(theirs)


@pytest.fixture(scope="module")
def console(
    tmp_path_factory: pytest.TempPathFactory, pty: tuple[int, int]
) -> Iterator[ConsoleProcess]:
    """A console in a terminal; its lease outlasts a busy machine."""
    folder = tmp_path_factory.mktemp("console")
    long_lease = {"lease_seconds = 5.0": "lease_seconds = 600.0"}
    options = (*configured(folder, long_lease, LATE_TICKS), "--plant", "kinematic")
    with ConsoleProcess(folder, *options, terminal=pty[1]) as running:
        running.wait_until_running()
        running.take_lease()
        yield running


@pytest.fixture
def link(console: ConsoleProcess) -> Iterator[WebLink]:
    """Enabled, with a web process that hangs for the length of the test."""
    if console.wait_until_running()["safety"]["state"] == "FAULT":
        console.call("POST", f"{console.robot_path}/reset")
    console.enable()
    web = console.children()[1]
    reader = WebLink(console.directory)
    os.kill(web, signal.SIGSTOP)
    yield reader
    os.kill(web, signal.SIGCONT)
    reader.close()


def asked_for(console: ConsoleProcess) -> list[tuple[str, str]]:
    """Changes of state in the log, without those that a busy machine brings by itself."""
    found = newest(console.audit, 100, event="state_changed")
    asked = ("NOTHING", "ENABLE", "DISABLE", "RESET", "EMERGENCY_STOP")
    return [(one["state"], one["reason"]) for one in found if one["reason"] in asked]


def keyhole(console: ConsoleProcess, *arguments: str) -> subprocess.CompletedProcess[str]:
    state = {"XDG_STATE_HOME": str(console.audit.parents[1])}
    return subprocess.run(
        command_line(*arguments),
        env={**module_environment(), **state},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def safety(link: WebLink) -> tuple[str, int]:
    state = link.snapshot()["outcome"]["state"]
    return Safety(int(state["safety"][0])).name, int(state["reason"][0])


def test_the_stop_command_needs_no_web_process(console: ConsoleProcess, link: WebLink) -> None:
    told = keyhole(console, "stop", "--run-directory", str(console.directory))
    assert told.returncode == 0, told.stderr
    took = re.search(r"holds in FAULT after ([\d.]+) ms", told.stdout)
    assert took is not None, told.stdout
    assert 0.0 <= float(took[1]) < 2000.0
    assert safety(link)[0] == "FAULT"
    (entry,) = newest(console.audit, 1, event="emergency_stop")
    assert (entry["source"], entry["by"]) == ("stop", "keyhole stop")
    assert entry["took_ms"] == pytest.approx(float(took[1]), abs=0.06)


def test_enter_in_the_terminal_stops(
    console: ConsoleProcess, link: WebLink, pty: tuple[int, int]
) -> None:
    os.write(pty[0], b"\n")
    eventually(lambda: safety(link)[0] == "FAULT", "the robot is stopped")
    eventually(lambda: "from the terminal: the robot holds after" in console.errors(), "it says so")
    entry = eventually(
        lambda: [
            one
            for one in newest(console.audit, 10, event="emergency_stop")
            if one["by"] == "terminal"
        ],
        "it is noted",
    )[0]
    assert entry["source"] == "supervisor"


def test_the_log_tells_starts_and_every_change_of_state(console: ConsoleProcess) -> None:
    entries = newest(console.audit, 1000)
    started = {one["process"] for one in entries if one["event"] == "process_started"}
    assert {"web", "control", "recorder"} <= started
    assert entries[0]["source"] == "supervisor"
    assert len({one["run"] for one in entries}) == 1
    expected = [
        ("DISABLED", "NOTHING"), ("ENABLED", "ENABLE"), ("FAULT", "EMERGENCY_STOP"),
        ("DISABLED", "RESET"), ("ENABLED", "ENABLE"), ("FAULT", "EMERGENCY_STOP"),
    ]  # fmt: skip
    eventually(lambda: asked_for(console) == expected, "the changes are noted, once")


def test_a_recorder_that_is_killed_misses_no_change(console: ConsoleProcess) -> None:
    before = asked_for(console)
    found = newest(console.audit, 1000, event="process_started")
    recorder = next(one["child"] for one in reversed(found) if one["process"] == "recorder")
    os.kill(recorder, signal.SIGKILL)
    console.call("POST", f"{console.robot_path}/reset")
    console.enable()
    console.call("POST", f"{console.robot_path}/disable")
    expected = [("DISABLED", "RESET"), ("ENABLED", "ENABLE"), ("DISABLED", "DISABLE")]
    eventually(
        lambda: asked_for(console) == before + expected, "the changes stand in the log, once"
    )
    ended = newest(console.audit, 10, event="process_ended")
    assert (ended[-1]["process"], ended[-1]["cause"]) == ("recorder", "signal SIGKILL")


def test_a_stop_that_is_not_seen_is_not_called_one(
    console: ConsoleProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    console.wait_until_running()
    control = console.children()[0]
    os.kill(control, signal.SIGSTOP)
    try:
        status = execute(argparse.Namespace(run_directory=console.directory))
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(control, signal.SIGCONT)
    assert status == 1
    assert "does not confirm it; use the stop on the machine" in capsys.readouterr().out
    console.wait_until_running()


def test_where_nothing_runs_the_command_says_what_to_do(
    console: ConsoleProcess, tmp_path: Path
) -> None:
    told = keyhole(console, "stop", "--run-directory", str(tmp_path))
    assert told.returncode == 2
    assert "no console runs in" in told.stderr
    assert "use the stop on the machine" in told.stderr
    create_mapped_files(tmp_path, 500.0, 0.01)
    create_replay_files(tmp_path)
    told = keyhole(console, "stop", "--run-directory", str(tmp_path))
    assert told.returncode == 2
    assert "shows a recording" in told.stderr
    assert NothingToStop(tmp_path, "x").code == "nothing_to_stop"


def test_a_terminal_is_read_line_by_line_and_never_waited_for() -> None:
    ours, theirs = os.openpty()
    terminal = Terminal(theirs)
    assert terminal.descriptors() == [theirs]
    attributes = termios.tcgetattr(theirs)
    assert attributes[3] & termios.ICANON
    os.write(ours, b"s\n")
    assert terminal.pressed()
    os.write(ours, b"\x04")
    assert not terminal.pressed()
    assert terminal.descriptors() == []
    os.close(ours)
    os.close(theirs)
    reading, writing = os.pipe()
    assert not Terminal(reading).is_there
    assert not Terminal(None).is_there
    os.close(reading)
    os.close(writing)
