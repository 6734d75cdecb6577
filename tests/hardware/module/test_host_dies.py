"""When the host dies, the servos stop by their own watchdogs."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from hardware.fake_servos.client import FakeServosProcess

ROOT = Path(__file__).resolve().parents[3]
LATEST_NS = 60_000_000
TRIES = 8
"""A machine that stands still for a watchdog's time trips it before the host is killed."""


def kill_a_moving_host(process: FakeServosProcess, port: Path) -> tuple[int, int]:
    """Kill a host while its servos move; gives instants before and after it (monotonic, ns)."""
    for _ in range(TRIES):
        command = [sys.executable, "-m", "tests.hardware.module.moving_host", str(port)]
        with subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(ROOT)}
        ) as host:
            assert host.stdout is not None
            assert host.stdout.readline() == b"moving\n"
            began_ns = time.monotonic_ns()
            time.sleep(0.5)
            moving = process.servos.state()["servos"]
            before_ns = time.monotonic_ns()
            host.kill()
            after_ns = time.monotonic_ns()
        tripped_ns = [servo["tripped_ns"] for servo in process.servos.state()["servos"]]
        held = any(began_ns < instant < before_ns for instant in tripped_ns)
        if not held and all(servo["velocity"] != 0.0 for servo in moving):
            return before_ns, after_ns
    raise AssertionError(f"in each of {TRIES} tries a servo stood before the host died")


def test_servos_stop_by_themselves_when_the_host_is_killed(tmp_path: Path) -> None:
    link = tmp_path / "ttyFAKE0"
    with FakeServosProcess(link) as process:
        before_ns, after_ns = kill_a_moving_host(process, link)
        time.sleep(0.2)
        stopped = process.servos.state()["servos"]
        assert all(servo["torque"] for servo in stopped)
        for servo in stopped:
            assert before_ns < servo["tripped_ns"] < after_ns + LATEST_NS
        # Nothing moves any more but what the load gives way to.
        time.sleep(0.1)
        later = process.servos.state()["servos"]
        for before, after in zip(stopped, later, strict=True):
            assert abs(after["ticks"] - before["ticks"]) < 1.0
