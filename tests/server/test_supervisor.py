"""The supervisor, with real processes: start, restarts, and ends of every kind."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.error import HTTPError

import pytest

from server.command_line import main
from server.supervision.child_process import module_environment
from tests.configured import LATE_TICKS, configured
from tests.server.console_process import (
    ConsoleProcess,
    command_line,
    eventually,
    is_alive,
)

QUICK = ("--plant", "kinematic")
"""What the supervisor does is the same for every plant; this one starts in half the time."""


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleProcess]:
    folder = tmp_path_factory.mktemp("console")
    with ConsoleProcess(folder, *configured(folder, LATE_TICKS), *QUICK) as running:
        running.wait_until_running()
        yield running


def refused(*arguments: str) -> str:
    """The one line with which the command refuses to start."""
    result = subprocess.run(
        command_line(*arguments),
        env=module_environment(),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == 2, result.stderr
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1, result.stderr
    return result.stderr


def has_lease(console: ConsoleProcess) -> bool:
    """Try to take the lease; an earlier one may still run."""
    try:
        console.take_lease()
    except HTTPError as error:
        if error.code != HTTPStatus.CONFLICT:
            raise
        return False
    return True


def enable(console: ConsoleProcess) -> None:
    eventually(lambda: has_lease(console), "the lease is free")
    console.enable()


def told_down(console: ConsoleProcess) -> dict[str, Any]:
    """The state message if it says that control is down."""
    state = console.state()
    return state if state["control"] == "down" else {}


def test_it_starts_disabled_and_ticks(console: ConsoleProcess) -> None:
    state = console.wait_until_running()
    assert state["safety"]["state"] == "DISABLED"
    eventually(lambda: console.state()["tick"] > state["tick"] + 100, "ticks")
    realtime = state["loop"]["realtime"]
    assert realtime.startswith(("SCHED_FIFO", "off: "))
    said = f"real-time scheduling: {realtime}"
    eventually(lambda: said in console.errors(), "it is said")


def test_its_files_are_closed_to_others(console: ConsoleProcess) -> None:
    for path in (console.directory, *console.directory.iterdir()):
        assert path.stat().st_mode & 0o077 == 0, path


def test_a_second_console_in_the_same_run_directory_is_refused(console: ConsoleProcess) -> None:
    line = refused("--port", "0", "--run-directory", str(console.directory))
    assert f"process {console.process.pid}, {console.base}/" in line
    assert "--run-directory" in line


def test_a_busy_port_is_refused(console: ConsoleProcess, tmp_path: Path) -> None:
    port = console.base.rpartition(":")[2]
    line = refused("--port", port, "--run-directory", str(tmp_path / "run"))
    assert f"port {port} on 127.0.0.1 is taken by another program" in line


def test_web_is_restarted_and_control_goes_on(console: ConsoleProcess) -> None:
    console.wait_until_running()
    enable(console)
    control, web = console.children()
    with console.link() as link:
        os.kill(web, signal.SIGKILL)
        killed = link.snapshot()["header"]["tick"][0]
        eventually(lambda: console.children()[1] not in (0, web), "web is started again")
        eventually(lambda: link.snapshot()["header"]["tick"][0] > killed + 100, "ticks go on")
    # The operator is gone with the web process.
    state = console.wait_until_running()
    assert state["safety"]["state"] == "PAUSED"
    assert state["safety"]["reason_code"] == "operator_lost"
    assert console.children()[0] == control
    assert console.call("GET", "/api/v1/health")["status"] == "ok"
    said = "web ended unexpectedly (signal SIGKILL)"
    eventually(lambda: said in console.errors(), "it is said")


def test_a_killed_control_process_is_down_and_comes_back_disabled(
    console: ConsoleProcess,
) -> None:
    console.wait_until_running()
    enable(console)
    control, web = console.children()
    os.kill(control, signal.SIGKILL)
    down = eventually(lambda: told_down(console), "down")
    assert "signal SIGKILL" in down["safety"]["reason"]
    state = console.wait_until_running()
    assert state["safety"]["state"] == "DISABLED"
    assert console.children()[0] != control
    assert console.children()[1] == web
    time.sleep(0.5)
    assert console.state()["safety"]["state"] == "DISABLED"
    enable(console)


def test_a_control_process_that_hangs_is_replaced(console: ConsoleProcess) -> None:
    console.wait_until_running()
    control, _ = console.children()
    os.kill(control, signal.SIGSTOP)
    eventually(lambda: console.children()[0] not in (0, control), "control is replaced", 20.0)
    assert console.wait_until_running()["safety"]["state"] == "DISABLED"
    eventually(lambda: "has not ticked" in console.errors(), "it is said")


def ends_in_order(console: ConsoleProcess, number: signal.Signals) -> None:
    """End a console that runs by a signal."""
    children = console.children()
    console.process.send_signal(number)
    assert console.process.wait(15.0) == 0
    assert not any(is_alive(child) for child in children)
    left = sorted(path.name for path in console.directory.iterdir())
    assert left == ["console.lock", "control.lock"]
    assert "by force" not in console.errors()
    assert "Traceback" not in console.errors()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_in_order(tmp_path: Path, number: signal.Signals) -> None:
    with ConsoleProcess(tmp_path, *QUICK) as console:
        console.wait_until_running()
        ends_in_order(console, number)


def test_it_ends_while_it_still_starts(tmp_path: Path) -> None:
    with ConsoleProcess(tmp_path) as console:
        eventually(lambda: all(console.children()), "children")
        children = console.children()
        console.process.terminate()
        assert console.process.wait(15.0) == 0
        assert not any(is_alive(child) for child in children)


def test_children_end_when_the_supervisor_is_killed(tmp_path: Path) -> None:
    with ConsoleProcess(tmp_path, *QUICK) as console:
        console.wait_until_running()
        children = console.children()
        with console.link() as link:
            console.process.kill()
            console.process.wait()
            eventually(lambda: not any(is_alive(child) for child in children), "children end")
            # Control ended by itself, in order, and said so.
            assert link.status()["phase"] == "ended"
    # The next one, with the robot as it is configured, is not troubled by what was left.
    with ConsoleProcess(tmp_path) as again:
        again.wait_until_running()
        ends_in_order(again, signal.SIGHUP)


def test_a_broken_configuration_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def words(*arguments: str) -> str:
        assert main([*arguments, "--run-directory", str(tmp_path / "run")]) == 2
        output, errors = capsys.readouterr()
        assert output == ""
        assert errors.count("\n") == 1, errors
        return errors

    broken = tmp_path / "broken.toml"
    broken.write_text("schema_version = ")
    assert f"{broken}: is not TOML" in words("--config", str(broken))
    broken.write_text("schema_version = 2")
    assert f"{broken}: schema_version = 2 is refused" in words("--config", str(broken))
    missing = str(tmp_path / "missing.toml")
    assert f"{missing}: No such file" in words("console", "--config", missing)
    assert "unknown robot 'snake'" in words("--robot", "snake")


def test_a_start_that_cannot_be_reached_ends_the_console(tmp_path: Path) -> None:
    far = {"position_m = [0.400, 0.0, 0.120]": "position_m = [4.0, 0.0, 0.120]"}
    with ConsoleProcess(tmp_path, *configured(tmp_path, far)) as console:
        assert console.process.wait(60.0) == 2
        assert "the start cannot be reached" in console.errors()
        assert "Traceback" not in console.errors()


def test_an_address_that_is_not_ours_is_refused(tmp_path: Path) -> None:
    run = ("--port", "0", "--run-directory", str(tmp_path / "run"))
    assert "192.0.2.1 is not an address of this machine" in refused("--host", "192.0.2.1", *run)


def test_a_public_address_is_warned_about(tmp_path: Path) -> None:
    with ConsoleProcess(tmp_path, "--host", "0.0.0.0") as console:
        assert console.base.startswith("http://127.0.0.1:")
        eventually(lambda: "warning: listening on 0.0.0.0" in console.errors(), "the warning")


def test_the_port_stays_ours_while_web_is_down(console: ConsoleProcess) -> None:
    port = int(console.base.rpartition(":")[2])
    _, web = console.children()
    os.kill(web, signal.SIGKILL)
    with socket.create_connection(("127.0.0.1", port), timeout=5.0):
        pass
    assert console.wait_until_running()
