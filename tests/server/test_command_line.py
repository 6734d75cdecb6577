"""The command line: the default command, one-line refusals, and broken pipes."""

from __future__ import annotations

import argparse
import subprocess
import sys
from typing import Any

import pytest

from robot.errors import KeyholeError
from server import command_line
from server.command_line import COMMANDS, main
from server.commands import console as console_command
from server.configuration_file import load
from server.supervision.child_process import module_command, module_environment
from server.version import version


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[argparse.Namespace]:
    """The arguments of each console that would have been started."""
    calls: list[argparse.Namespace] = []

    def execute(arguments: argparse.Namespace) -> int:
        calls.append(arguments)
        return 0

    monkeypatch.setattr(console_command, "execute", execute)
    return calls


@pytest.mark.parametrize(
    ("arguments", "port", "no_browser"),
    [
        ([], None, False),
        (["console"], None, False),
        (["--port", "8123"], 8123, False),
        (["console", "--port", "0", "--no-browser"], 0, True),
        (["--no-browser"], None, True),
    ],
)
def test_the_console_is_the_default(
    started: list[argparse.Namespace], arguments: list[str], port: int | None, no_browser: bool
) -> None:
    assert main(arguments) == 0
    assert (started[0].port, started[0].no_browser) == (port, no_browser)
    assert console_command.configured(load(), started[0]).robot == "instrument"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--port", "70000"], "is not a port; give a number from 0 to 65535"),
        (["--port", "http"], "is not a port"),
        (["--speed", "3"], "unrecognized arguments"),
        (["--preset", "perfect"], "invalid choice: 'perfect'"),
        (["--seed", "-1"], "is not a seed"),
        (["--board", "chess"], "invalid choice: 'chess'"),
        (["fly"], "invalid choice: 'fly'"),
        (["bench"], "required"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("keyhole")
    assert words in told.err
    assert told.err.count("\n") == 1


def test_the_command_line_chooses_the_robot(started: list[argparse.Namespace]) -> None:
    assert main(["--robot", "concentric", "--method", "snsqp", "--start", "3"]) == 0
    assert main(["--robot", "hardware"]) == 0
    file = load()
    first, second = (console_command.configured(file, arguments) for arguments in started)
    assert (first.robot, first.concentric.method, first.concentric.start) == (
        "concentric", "snsqp", 3,
    )  # fmt: skip
    assert not first.drives_hardware
    assert (second.robot, second.drives_hardware) == ("instrument", True)


def test_the_command_line_replaces_what_the_configuration_says(
    started: list[argparse.Namespace],
) -> None:
    assert main(["--plant", "kinematic", "--seed", "7", "--tracker", "on"]) == 0
    wanted = ["--preset", "harsh", "--board", "none", "--compensation", "gain"]
    assert main([*wanted, "--actuation", "tension-unit"]) == 0
    file = load()
    first, second = (console_command.configured(file, arguments) for arguments in started)
    assert (first.simulation.plant, first.simulation.seed) == ("kinematic", 7)
    assert first.tracker.enabled
    assert first.simulation.preset == file.simulation.preset
    assert (second.simulation.preset, second.simulation.board) == ("harsh", "none")
    assert second.compensation.mode == "gain"
    assert second.simulation.actuation == "tension-unit"
    assert first.simulation.actuation == "servos"
    assert second.tracker == file.tracker
    assert type(first).model_validate(first.model_dump()) == first


def test_a_refusal_is_one_line_and_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(_: Any) -> int:
        raise KeyholeError("first\nsecond")

    monkeypatch.setattr(console_command, "execute", refuse)
    assert main([]) == 2
    assert capsys.readouterr().err == "keyhole: first second\n"


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    listed = {line.split()[0] for line in told.splitlines() if line.startswith("    ")}
    assert set(COMMANDS) <= listed


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"keyhole {version()}\n"


def test_an_interrupt_has_its_own_status(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(_: Any) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(console_command, "execute", interrupt)
    assert main([]) == 130


def test_only_the_asked_command_is_imported(
    monkeypatch: pytest.MonkeyPatch, started: list[argparse.Namespace]
) -> None:
    monkeypatch.setitem(command_line.COMMANDS, "run", "no.such.module")
    assert main(["--no-browser"]) == 0
    assert len(started) == 1


def test_a_reader_that_goes_away_is_no_error() -> None:
    process = subprocess.Popen(
        module_command("server.command_line", ["states"]),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=module_environment(),
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == b""
    process.stderr.close()
    process.wait()


TESTS_ONLY = ("dynamixel_sdk", "hypothesis", "pink", "playwright", "pytest", "qpsolvers", "xarm")


def test_the_commands_need_nothing_that_only_the_tests_install() -> None:
    blocked = "; ".join(f"sys.modules[{name!r}] = None" for name in TESTS_ONLY)
    program = (
        f"import sys; {blocked}; from server.command_line import main; "
        "import benchmarks.tubes; sys.exit(main(['--help']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True, text=True, check=False, env=module_environment(),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
