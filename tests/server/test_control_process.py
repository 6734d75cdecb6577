"""The control process alone, driven through the link: emergency stop in ticks, rate, end."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from benchmarks.console import START_S
from robot.records import LeaderKind, Request, Safety
from server.configuration_file import load
from server.memory.link import WebLink
from server.memory.link_records import create_mapped_files
from server.memory.run_directory import RunDirectory
from server.supervision.child_process import module_command, module_environment
from tests.server.console_process import eventually

PRESSES = 20


class Running(NamedTuple):
    """A control process without a supervisor or a web process, and this test as its web side."""

    process: subprocess.Popen[bytes]
    link: WebLink
    lifeline: int


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Running]:
    configuration = load()
    directory = RunDirectory.take(tmp_path / "run")
    directory.write_configuration(configuration)
    create_mapped_files(directory.path, configuration.control.rate_hz, 20.0)
    reading, writing = os.pipe()
    arguments = ["--run-directory", str(directory.path), "--lifeline-fd", str(reading)]
    process = subprocess.Popen(
        module_command("server.control.process", arguments),
        pass_fds=[reading],
        env=module_environment(),
        stderr=subprocess.PIPE,
    )
    os.close(reading)
    link = WebLink(directory.path)
    try:
        eventually(lambda: link.ring().sequence > 10, "control ticks", START_S)
        yield Running(process, link, writing)
    finally:
        process.kill()
        process.communicate()
        directory.give_back()


def ask(link: WebLink, request: Request) -> Any:
    """Send a request and wait for it; returns the (1,) record after it."""
    return taken_in(link, link.request(request))


def taken_in(link: WebLink, number: int) -> Any:
    """The first (1,) record seen after request ``number`` was taken in."""

    def record() -> Any:
        found = link.snapshot()
        return found if found["header"]["request_sequence"][0] >= number else None

    return eventually(record, f"request {number} is taken in", every_s=0.001)


def is_moving(link: WebLink) -> bool:
    return bool(link.snapshot()["outcome"]["command"]["moving"][0])


def drive(link: WebLink, sequence: int) -> None:
    """Send the tip 20 mm away, there and back in turn, and wait until it is on its way."""
    report = link.snapshot()["outcome"]["report"][0]
    away = 0.02 if sequence % 2 else -0.02
    link.leader(
        LeaderKind.API_TARGET,
        sequence=sequence,
        clutch=True,
        position=report["commanded_position"] + np.array([0.0, away, 0.0]),
        wxyz=report["commanded_wxyz"],
        absolute=True,
        smoothing_s=0.0,
        timeout_s=60.0,
    )
    eventually(lambda: is_moving(link), "the tip moves", every_s=0.001)


def test_an_emergency_stop_stops_within_two_ticks(running: Running) -> None:
    link, ring, ticks = running.link, running.link.ring(), []
    for press in range(1, PRESSES + 1):
        assert ask(link, Request.ENABLE)["outcome"]["state"]["safety"][0] == Safety.ENABLED
        drive(link, press)
        pressed_ns, first = time.monotonic_ns(), ring.sequence
        taken_in(link, link.emergency_stop())
        records, _, gap = ring.read_since(first - 1)
        assert not gap
        after = records[records["header"]["stamp_ns"] > pressed_ns]
        moving = after["outcome"]["command"]["moving"].tolist()
        ticks.append(moving.index(0) + 1)
        assert not any(moving[moving.index(0) :])
        stopped = after[ticks[-1] - 1]["outcome"]
        assert stopped["state"]["safety"] == Safety.FAULT
        assert np.array_equal(stopped["command"]["q"], after[-1]["outcome"]["command"]["q"])
        ask(link, Request.RESET)
    print(f"emergency stop: {PRESSES} presses, ticks to zero motion: {sorted(ticks)}")
    assert max(ticks) <= 2


def test_after_a_stop_the_old_target_is_not_gone_on_with(running: Running) -> None:
    link = running.link
    ask(link, Request.ENABLE)
    drive(link, 1)
    taken_in(link, link.emergency_stop())
    ask(link, Request.RESET)
    assert ask(link, Request.ENABLE)["outcome"]["state"]["safety"][0] == Safety.ENABLED
    time.sleep(0.1)
    assert not is_moving(link)
    drive(link, 2)


def test_a_path_counts_as_taken_in_when_it_plays(running: Running) -> None:
    link = running.link
    ask(link, Request.ENABLE)
    samples = np.zeros((20_000, 8))
    samples[:, 0], samples[:, 4] = np.arange(20_000) * 0.01, 1.0
    samples[:, 1] = 0.01 * np.sin(samples[:, 0])
    record = taken_in(link, link.start_path(samples, "wave"))
    assert link.status()["paths"][int(record["header"]["path_id"][0])] == "wave"
    eventually(lambda: is_moving(link), "the tip moves")
    assert ask(link, Request.PAUSE)["header"]["path_id"][0] == 0
    ask(link, Request.ENABLE)
    assert not is_moving(link)


def test_records_are_numbered_and_on_time(running: Running) -> None:
    ring, rate = running.link.ring(), running.link.status()["rate_hz"]
    first = ring.sequence
    time.sleep(1.0)
    records, _, gap = ring.read_since(first)
    assert not gap
    header = records["header"]
    assert (np.diff(header["tick"]) == 1).all()
    assert (np.diff(header["time_ns"]) == round(1e9 / rate)).all()
    lost = int(header["overruns"][-1] - header["overruns"][0])
    assert abs(len(records) + lost - rate) < 0.2 * rate
    assert (header["lateness_ns"] >= 0).all()


@pytest.mark.parametrize("how", ["SIGTERM", "lifeline"])
def test_it_holds_and_ends_in_order(running: Running, how: str) -> None:
    ask(running.link, Request.ENABLE)
    drive(running.link, 1)
    if how == "SIGTERM":
        running.process.send_signal(signal.SIGTERM)
    os.close(running.lifeline)
    assert running.process.wait(5.0) == 0
    assert running.link.status()["phase"] == "ended" or running.link.status()["pid"] == 0


def test_two_control_processes_do_not_share_a_robot(running: Running) -> None:
    directory = RunDirectory(running.link.ring().path.parent)
    assert directory.lock_control() is None
