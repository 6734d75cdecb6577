"""A failure stands, unless the machine stood still while the test ran."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.server.console_process import eventually
from tests.stalls import LONGEST_MS, StallWatch

ROOT = Path(__file__).resolve().parent.parent

FAILING = """
import os, signal, time
from tests.conftest import WATCH

tries = []

def test_fails_in_stalls(pytestconfig):
    tries.append(1)
    if len(tries) < 3:
        time.sleep(0.3)
        watch = pytestconfig.stash[WATCH].process.pid
        os.kill(watch, signal.SIGSTOP)
        time.sleep(0.2)
        os.kill(watch, signal.SIGCONT)
        time.sleep(0.2)
        assert False

def test_fails():
    assert False
"""


def test_a_process_that_stood_still_is_told_of() -> None:
    watch = StallWatch()
    began = time.monotonic()
    time.sleep(0.3)
    os.kill(watch.process.pid, signal.SIGSTOP)
    time.sleep(0.2)
    os.kill(watch.process.pid, signal.SIGCONT)
    stalls = eventually(lambda: watch.since(began), "the stall is seen")
    assert any(stall.lasted_ms > 150.0 for stall in stalls)
    assert all(stall.lasted_ms > LONGEST_MS for stall in stalls)
    assert not watch.since(time.monotonic())
    watch.close()


def test_only_what_failed_in_a_stall_runs_again(tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    (tmp_path / "test_failing.py").write_text(FAILING)
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-raR", "-p", "tests.conftest", str(tmp_path)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert "1 failed, 1 passed, 2 rerun" in result.stdout
    assert "FAILED test_failing.py::test_fails - assert False" in result.stdout
    assert "RERUN test_failing.py::test_fails_in_stalls" in result.stdout
