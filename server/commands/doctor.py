"""``keyhole doctor``: what is well on this machine, what is not, and what to do about it."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from pathlib import Path

_SOMETHING_FAILED = 1
_WIDEST = 100


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``doctor`` to the command line."""
    parser = subparsers.add_parser(
        "doctor",
        help="examine ports, servos, arm and machine, and say what to do",
        description="Examines and changes nothing. Exit status 1 when something must be put right.",
    )
    parser.add_argument("--config", metavar="FILE", type=Path, help="configuration file")
    parser.add_argument("--port", help="the servos' port, in place of the configuration's")
    parser.add_argument("--baud", type=int, help="their speed, in place of the configuration's")
    parser.add_argument(
        "--scan",
        action="store_true",
        help="look for servos at every speed; takes a quarter of a minute",
    )
    parser.add_argument("--json", action="store_true", help="for programs")
    parser.add_argument(
        "--run-directory", metavar="DIR", type=Path, help="of the console, where it has its own"
    )


def execute(arguments: argparse.Namespace) -> int:
    """Examine and report.

    Returns:
        0 when nothing failed, else 1.
    """
    from server.doctor.examination import examine
    from server.doctor.finding import Level
    from server.doctor.report import as_json, as_text, worst

    def say(words: str) -> None:
        if sys.stderr.isatty():
            print(f"… {words}", file=sys.stderr)

    findings = examine(
        arguments.config,
        arguments.port,
        arguments.baud,
        arguments.scan,
        arguments.run_directory,
        say,
    )
    if arguments.json:
        print(as_json(findings))
    else:
        coloured = sys.stdout.isatty() and "NO_COLOR" not in os.environ
        width = min(shutil.get_terminal_size().columns, _WIDEST)
        print(as_text(findings, width, coloured))
    return _SOMETHING_FAILED if worst(findings) is Level.FAIL else 0
