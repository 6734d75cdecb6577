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


def test_servos_stop_by_themselves_when_the_host_is_killed(tmp_path: Path) -> None:
    link = tmp_path / "ttyFAKE0"
    with FakeServosProcess(link) as process:
        command = [sys.executable, "-m", "tests.hardware.module.moving_host", str(link)]
        with subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(ROOT)}
        ) as host:
            assert host.stdout is not None
            assert host.stdout.readline() == b"moving\n"
            time.sleep(0.5)
            moving = process.servos.state()["servos"]
            killed_ns = time.monotonic_ns()
            host.kill()
        time.sleep(0.2)
        stopped = process.servos.state()["servos"]
        assert all(servo["torque"] for servo in stopped)
        for before, after in zip(moving, stopped, strict=True):
            assert before["tripped_ns"] == 0
            assert before["velocity"] != 0.0
            assert 0 < after["tripped_ns"] - killed_ns < LATEST_NS
        # Nothing moves any more but what the load gives way to.
        time.sleep(0.1)
        later = process.servos.state()["servos"]
        for before, after in zip(stopped, later, strict=True):
            assert abs(after["ticks"] - before["ticks"]) < 1.0
