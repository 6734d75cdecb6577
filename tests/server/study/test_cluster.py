"""A study on a Dask cluster: real scheduler and worker processes on loopback."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.command_line import main
from server.study import cluster_workers
from server.supervision.child_process import module_command, module_environment
from tests.server.study.test_study import documents

PATIENCE_S = 120.0
TINY = ["study", "--plants", "kinematic", "--experiments", "circle", "--cases", "0,1"]
ARGUMENTS = [*TINY, "--seconds", "0.3"]


def start(module: str, arguments: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        module_command(module, arguments),
        env=module_environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a scheduler that has no workers yet."""
    file = tmp_path_factory.mktemp("cluster") / "scheduler.json"
    arguments = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show"]
    process = start("distributed.cli.dask_scheduler", [*arguments, "--scheduler-file", str(file)])
    try:
        until = time.monotonic() + PATIENCE_S
        while not (file.exists() and file.read_text().endswith("}")):
            assert time.monotonic() < until
            assert process.poll() is None
            time.sleep(0.05)
        yield str(json.loads(file.read_text())["address"])
    finally:
        process.terminate()
        process.wait(PATIENCE_S)


def test_a_scheduler_without_workers_is_refused(
    scheduler: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*ARGUMENTS, "--out", str(tmp_path), "--scheduler", scheduler]) == 2
    assert f"has no workers: start some with dask worker {scheduler}" in capsys.readouterr().err


@pytest.fixture
def worker(scheduler: str, tmp_path: Path) -> Iterator[None]:
    arguments = ["--no-nanny", "--nthreads", "2", "--no-dashboard"]
    process = start(
        "distributed.cli.dask_worker",
        [scheduler, *arguments, "--local-directory", str(tmp_path / "scratch")],
    )
    try:
        yield
    finally:
        process.terminate()
        process.wait(PATIENCE_S)


def test_a_cluster_gives_the_same_files_as_this_machine(
    scheduler: str, worker: None, tmp_path: Path
) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    assert main([*ARGUMENTS, "--out", str(here), "--jobs", "1"]) == 0
    until = time.monotonic() + PATIENCE_S
    # The worker may still be on its way to the scheduler.
    while main([*ARGUMENTS, "--out", str(there), "--scheduler", scheduler]) != 0:
        assert time.monotonic() < until
    assert documents(here) == documents(there)
    assert len(documents(there)) == 2
    for trace in here.glob("*.npz"):
        assert trace.read_bytes() == (there / trace.name).read_bytes()


def test_a_silent_address_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cluster_workers, "_PATIENCE_S", 0.3)
    for address in ("tcp://127.0.0.1:9", "nonsense"):
        assert main([*ARGUMENTS, "--out", str(tmp_path), "--scheduler", address]) == 2
        assert f"no scheduler answers at {address}" in capsys.readouterr().err


def test_without_the_extra_the_install_command_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main([*ARGUMENTS, "--out", str(tmp_path), "--scheduler", "tcp://127.0.0.1:9"]) == 2
    complaint = capsys.readouterr().err
    assert "keyhole[cluster]" in complaint
    assert "pip install -c constraints.txt distributed" in complaint
