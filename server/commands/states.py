"""``keyhole states``: the safety transition table, printed."""

from __future__ import annotations

import argparse

from robot.safety import printed_table


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``states`` to the command line."""
    subparsers.add_parser("states", help="print the safety transition table")


def execute(_: argparse.Namespace) -> int:
    """Print it."""
    print(printed_table())
    return 0
