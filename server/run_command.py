"""``keyhole run``: an experiment or path file, headless; figures as JSON, a trace as CSV."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from pathlib import Path
from typing import Any

from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.priority.levels import CASE_NAMES
from scenes.experiments import experiment, names
from scenes.path_file import parse_csv
from server.configuration_file import load
from server.control.loop import COORDINATE_NAMES, SOLVER_NAMES
from server.headless_run import (
    TRACE_COLUMNS,
    HeadlessRun,
    RunOptions,
    RunResult,
    result_document,
)

_BAR_WIDTH = 30


class RunArgumentError(KeyholeError):
    """What was asked of ``keyhole run`` cannot be done."""

    code = "run_argument"


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``run`` to the command line."""
    parser = subparsers.add_parser("run", help="run an experiment or a path without a browser")
    parser.add_argument("name", nargs="?", help="name of the experiment (see --list)")
    parser.add_argument("--path", metavar="FILE", help="play a CSV path instead of an experiment")
    parser.add_argument("--list", action="store_true", help="list the experiments and stop")
    parser.add_argument("--case", choices=tuple(CASE_NAMES), help="priority case")
    parser.add_argument("--solver", choices=tuple(SOLVER_NAMES), help="how the levels are solved")
    parser.add_argument(
        "--coordinates", choices=tuple(COORDINATE_NAMES), help="segment coordinates (closed forms)"
    )
    parser.add_argument("--plant", choices=("kinematic",), default="kinematic", help="the robot")
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON (- for stdout)")
    parser.add_argument("--trace", metavar="FILE", help="write a CSV with a row a tick")


def execute(arguments: argparse.Namespace) -> int:
    """Run it.

    Returns:
        0 when the path was played to its end, 1 when it was stopped before.
    """
    configuration = load(arguments.config)
    if arguments.list:
        _print_list(configuration)
        return 0
    options = _options(arguments, configuration)
    _check_writable(arguments.json)
    _check_writable(arguments.trace)
    progress = _bar if sys.stderr.isatty() else _no_bar
    with _StopSignals() as stopped:
        result = HeadlessRun(configuration, options).execute(progress, stopped.received)
    if progress is _bar:
        print(file=sys.stderr)
    document = result_document(configuration, options, result, arguments.plant)
    if arguments.trace:
        _write_trace(arguments.trace, result)
    if arguments.json == "-":
        print(json.dumps(document, indent=2))
    else:
        if arguments.json:
            Path(arguments.json).write_text(json.dumps(document, indent=2) + "\n")
        _print_summary(document)
    return 0 if result.ended == "completed" else 1


def _options(arguments: argparse.Namespace, configuration: Configuration) -> RunOptions:
    if (arguments.name is None) == (arguments.path is None):
        raise RunArgumentError("give either the name of an experiment or --path FILE")
    priority = configuration.priority
    if arguments.path is not None:
        try:
            text = Path(arguments.path).read_text()
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "is not text (UTF-8)"
            raise RunArgumentError(f"{arguments.path}: {reason}") from None
        name, path = Path(arguments.path).name, parse_csv(text, arguments.path)
    else:
        name, path = arguments.name, experiment(arguments.name, configuration).path
    return RunOptions(
        name,
        path,
        arguments.case or priority.case,
        arguments.solver or priority.solver,
        arguments.coordinates or priority.coordinates,
    )


def _check_writable(name: str | None) -> None:
    """Refuse before the run what could not be written after it."""
    if name is None or name == "-":
        return
    try:
        with open(name, "a"):
            pass
    except OSError as error:
        raise RunArgumentError(f"{name} cannot be written: {error.strerror}") from None


class _StopSignals:
    """Turns the first SIGINT or SIGTERM into a question the run can ask; a second one ends it."""

    def __init__(self) -> None:
        self._received = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> _StopSignals:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._before[number] = signal.signal(number, self._receive)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _receive(self, *_: object) -> None:
        self._received = True
        self.__exit__()

    def received(self) -> bool:
        return self._received


def _bar(share: float) -> None:
    filled = round(share * _BAR_WIDTH)
    print(
        f"\r[{'#' * filled}{'.' * (_BAR_WIDTH - filled)}] {100 * share:3.0f} %",
        end="",
        file=sys.stderr,
        flush=True,
    )


def _no_bar(share: float) -> None:
    """Where nobody looks, no bar is drawn."""


def _write_trace(name: str, result: RunResult) -> None:
    with open(name, "w", newline="") as file:
        file.write(",".join(TRACE_COLUMNS) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in result.trace.tolist())


def _print_list(configuration: Configuration) -> None:
    for name in names():
        one = experiment(name, configuration)
        print(f"{name:<20} {one.duration_s:6.1f} s   {one.title}")


def _print_summary(document: dict[str, object]) -> None:
    errors = document["errors"]
    assert isinstance(errors, dict)
    print(
        f"{document['experiment']}: case {document['case']}, {document['solver']}, "
        f"{document['plant']} plant, {document['steps']} ticks: {document['ended']}"
    )
    for key, unit in (("position_mm", "mm"), ("orientation_deg", "deg"), ("rcm_mm", "mm")):
        values = errors[key]
        if values["max"] is not None:
            print(
                f"  {key.split('_')[0]:<12} max {values['max']:10.5f} {unit}   "
                f"rms {values['rms']:10.5f} {unit}   final {values['final']:10.5f} {unit}"
            )
    limits = document["limits"]
    assert isinstance(limits, dict)
    for words, share in limits["held_back"].items():
        print(f"  held back {100 * share:.1f} % of the time: {words}")
