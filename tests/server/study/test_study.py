"""``keyhole study`` as it is called: any number of jobs, stops, restarts, refusals."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from robot.errors import KeyholeError
from server.command_line import main
from server.commands.study import seeds
from server.supervision.child_process import module_command, module_environment
from tests.configured import configured

PATIENCE_S = 120.0
TINY = ["study", "--plants", "kinematic", "--experiments", "circle,arc", "--cases", "0,1"]
TIMED = ("tick_us", "realtime_factor")


def documents(folder: Path) -> dict[str, dict[str, Any]]:
    """Figures by file, without what the clock says."""
    found = {path.name: json.loads(path.read_text()) for path in folder.glob("*.json")}
    for document in found.values():
        for key in TIMED:
            del document[key]
    return found


def test_one_job_and_two_give_the_same_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [*TINY, "--seconds", "0.3"]
    for jobs in ("1", "2"):
        assert main([*arguments, "--jobs", jobs, "--out", str(tmp_path / jobs)]) == 0
    output = capsys.readouterr()
    one, two = (documents(tmp_path / jobs) for jobs in ("1", "2"))
    assert one == two
    assert len(one) == 4
    for name in one:
        trace = Path(name).with_suffix(".npz")
        assert (tmp_path / "1" / trace).read_bytes() == (tmp_path / "2" / trace).read_bytes()
    with open(tmp_path / "2" / "table.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["experiment"], row["case"]) for row in rows] == [
        ("circle", "0"),
        ("circle", "1"),
        ("arc", "0"),
        ("arc", "1"),
    ]
    assert output.out.count("completed") == 8
    assert "4/4 arc" in output.err


def children(pid: int) -> list[int]:
    with contextlib.suppress(OSError):
        return [int(one) for one in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []


def wait_for(words: str, met: Any) -> None:
    until = time.monotonic() + PATIENCE_S
    while not met():
        assert time.monotonic() < until, f"{words} did not come about"
        time.sleep(0.05)


@contextlib.contextmanager
def long_study(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A study of 12 runs in a process of its own; something of it is already finished."""
    arguments = [*TINY, "--seconds", "1", "--seeds", "1-3", "--jobs", "2", "--out", str(folder)]
    process = subprocess.Popen(
        module_command("server.command_line", arguments),
        env=module_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        wait_for("a finished run", lambda: len(list(folder.glob("*.json"))) >= 2)
        yield process
    finally:
        process.kill()
        process.communicate(timeout=PATIENCE_S)


def runs_on(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_killed_study_leaves_nobody_behind_and_goes_on_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "study"
    with long_study(folder) as process:
        workers = children(process.pid)
        process.send_signal(signal.SIGKILL)
        process.wait(PATIENCE_S)
    assert workers
    wait_for("the end of the workers", lambda: not any(runs_on(pid) for pid in workers))
    before = {path: path.stat().st_mtime_ns for path in folder.glob("*.json")}
    assert 2 <= len(before) < 12
    broken = min(before)
    broken.write_text('{"ended": "comp')
    again = [*TINY, "--seconds", "1", "--seeds", "1-3", "--out", str(folder)]
    assert main(again) == 0
    assert f"{len(before) - 1} of 12 runs were finished before" in capsys.readouterr().err
    after = {path: path.stat().st_mtime_ns for path in folder.glob("*.json")}
    assert len(after) == 12
    assert all(after[path] == stamp for path, stamp in before.items() if path != broken)
    assert all(document["ended"] == "completed" for document in documents(folder).values())
    assert (folder / "table.csv").read_text().count("completed") == 12
    assert main(again) == 0
    assert {path: path.stat().st_mtime_ns for path in folder.glob("*.json")} == after


def test_an_interrupted_study_ends_in_order(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    with long_study(folder) as process:
        workers = children(process.pid)
        process.send_signal(signal.SIGINT)
        output, complaint = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "Traceback" not in complaint
    assert "of 12 runs are finished; the same command goes on with the rest" in output
    wait_for("the end of the workers", lambda: not any(runs_on(pid) for pid in workers))
    finished = documents(folder)
    assert 2 <= len(finished) < 12
    assert (folder / "table.csv").read_text().count("completed") == len(finished)
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_a_run_that_cannot_be_made_is_named_and_the_rest_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    far = configured(tmp_path, {"[0.400, 0.0, 0.120] ": "[1.9, 0.0, 0.1] "})
    arguments = ["study", "--plants", "kinematic", "--experiments", "square", *far]
    assert main([*arguments, "--out", str(tmp_path / "study"), "--jobs", "1"]) == 1
    output = capsys.readouterr()
    assert "0 of 1 runs are finished" in output.out
    assert "square, case 0" in output.err
    assert "cannot be reached" in output.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "required: --out"),
        (["--out", "x", "--experiments", "spiral"], "invalid choice: 'spiral'"),
        (["--out", "x", "--cases", "0,3"], "invalid choice: '3'"),
        (["--out", "x", "--presets", "shiny"], "invalid choice: 'shiny'"),
        (["--out", "x", "--tracker", "maybe"], "invalid choice: 'maybe'"),
        (["--out", "x", "--compensation", "half"], "invalid choice: 'half'"),
        (["--out", "x", "--seeds", "5-1"], "'5-1' is no range"),
        (["--out", "x", "--seeds", "a"], "a seed is a whole number"),
        (["--out", "x", "--jobs", "0"], "must be a number from 1"),
        (["--out", "x", "--jobs", "1", "--scheduler", "tcp://y:1"], "either --jobs or --scheduler"),
        (["--out", "x", "--calibration", "no/such.toml"], "no/such.toml"),
        (["--out", "/dev/null/x"], "cannot be made"),
    ],
)
def test_what_cannot_be_studied_is_refused_in_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["study", *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.count("\n") == 1
    assert words in output.err
    assert not os.listdir(tmp_path)


def test_seeds_are_ranges_and_lists_without_repetition() -> None:
    assert seeds("1-5") == [1, 2, 3, 4, 5]
    assert seeds("7,1-3,2") == [7, 1, 2, 3]
    assert seeds("0") == [0]


def test_every_refusal_has_a_code_of_its_own() -> None:
    codes = [one.code for one in KeyholeError.__subclasses__() if one.__module__ != __name__]
    assert len(set(codes)) == len(codes)
