"""What the processes beside control have in common: their arguments, and how they end."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from robot.errors import KeyholeError
from server.control.lifeline import Lifeline

Stopped = Callable[[], bool]


def child_parser(name: str) -> argparse.ArgumentParser:
    """The parser of a process that the supervisor starts, with what all of them take.

    Args:
        name: of the process, for people.
    """
    parser = argparse.ArgumentParser(prog=f"keyhole {name}")
    parser.add_argument("--run-directory", required=True, type=Path)
    parser.add_argument("--lifeline-fd", type=int)
    return parser


def run_child(
    parser: argparse.ArgumentParser,
    argv: Sequence[str] | None,
    work: Callable[[argparse.Namespace, Stopped], None],
) -> int:
    """Work until SIGTERM, or until the supervisor is gone.

    Args:
        parser: of :func:`child_parser`.
        argv: the arguments; None for those of this process.
        work: is called with the parsed arguments and the question whether it shall end.

    Returns:
        0 when it was asked to end, 2 when it could not start or go on.
    """
    arguments = parser.parse_args(argv)
    ending: list[int] = []
    for ignored in (signal.SIGINT, signal.SIGHUP):
        # The supervisor gets them too, and ends everything in order.
        signal.signal(ignored, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda number, _: ending.append(number))
    lifeline = Lifeline(arguments.lifeline_fd)
    try:
        work(arguments, lambda: bool(ending) or lifeline.is_cut())
    except KeyholeError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr, flush=True)
        return 2
    return 0
