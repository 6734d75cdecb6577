"""What the doctor finds on the machine itself, and how it tells it."""

from __future__ import annotations

import json
import os
import resource
from pathlib import Path
from typing import NoReturn

import pytest

from robot.configuration import Hardware
from server.command_line import main
from server.doctor import arm, machine
from server.doctor.finding import Finding, Level, failure, fine, warning
from server.doctor.report import as_json, as_text, worst
from server.memory.run_directory import RunDirectory

ONE_OF_EACH = [
    fine("supply", "12.0 V", volt=12.0),
    warning("heat", "60 °C", "it stops when it gets hotter", "let it cool down"),
    failure("cable", "none", "nothing moves " * 12, "plug it in"),
]


def _refuse(*_: object) -> NoReturn:
    raise PermissionError(1, "Operation not permitted")


def test_a_refused_real_time_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", _refuse)
    finding = machine.scheduling()
    assert finding.level is Level.WARN
    assert "rtprio" in finding.advice


def test_a_permitted_real_time_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: None)
    assert machine.scheduling().level is Level.OK


def test_little_memory_that_may_be_locked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (65536, 8 * 2**20))
    finding = machine.memory()
    assert finding.level is Level.WARN
    assert finding.data == {"memlock_limit_bytes": 8 * 2**20}


def test_a_wrong_configuration_is_told_and_the_rest_goes_on(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("schema_version = 1\n", encoding="utf-8")
    used, finding = machine.configuration(file)
    assert finding.level is Level.FAIL
    assert "mine.toml" in finding.what
    assert used.servos.ids


def test_a_run_directory_in_use(tmp_path: Path) -> None:
    held = RunDirectory.take(tmp_path / "run")
    assert machine.run_directory(tmp_path / "run").level is Level.WARN
    held.give_back()
    assert machine.run_directory(tmp_path / "run").level is Level.OK
    os.chmod(tmp_path / "run", 0o755)
    assert machine.run_directory(tmp_path / "run").level is Level.FAIL


def test_an_arm_that_nobody_switched_on() -> None:
    settings = Hardware(connected=True, arm="xarm", arm_address="127.0.0.1:1", arm_rate_hz=250.0)
    assert [finding.level for finding in arm.examine(settings)] == [Level.FAIL]
    locked = settings.model_copy(update={"arm": "locked"})
    assert [finding.level for finding in arm.examine(locked)] == [Level.OK]


@pytest.mark.parametrize("width", [40, 80, 120])
def test_the_text_fits_and_its_colours_carry_nothing_alone(width: int) -> None:
    text = as_text(ONE_OF_EACH, width, False)
    assert "\033" not in text
    assert max(len(line) for line in text.splitlines()) <= max(width, 55)
    coloured = as_text(ONE_OF_EACH, width, True)
    for code in ("\033[32m", "\033[33m", "\033[31m", "\033[1m", "\033[0m"):
        coloured = coloured.replace(code, "")
    assert coloured == text
    assert text.endswith("One thing must be put right first.")


@pytest.mark.parametrize(
    ("findings", "level", "words"),
    [
        (ONE_OF_EACH[:1], Level.OK, "All is well."),
        (ONE_OF_EACH[:2], Level.WARN, "It works; one thing could be better."),
        ([*ONE_OF_EACH, ONE_OF_EACH[2]], Level.FAIL, "2 things must be put right first."),
    ],
)
def test_the_worst_counts(findings: list[Finding], level: Level, words: str) -> None:
    assert worst(findings) is level
    assert as_text(findings, 80, False).endswith(words)
    told = json.loads(as_json(findings))
    assert told["worst"] == level
    assert sum(told["counts"].values()) == len(told["findings"]) == len(findings)


def test_the_command_speaks_json_and_its_exit_status_says_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = str(tmp_path / "none")
    directory = ["--run-directory", str(tmp_path / "run")]
    assert main(["doctor", "--json", "--port", missing, *directory]) == 1
    told = json.loads(capsys.readouterr().out)
    levels = {finding["area"]: finding["level"] for finding in told["findings"]}
    assert levels["serial port"] == "fail"
    assert levels["configuration"] == "ok"
    assert main(["doctor", *directory]) in {0, 1}
    assert "\033" not in capsys.readouterr().out
