"""The ``keyhole`` command. Each subcommand is a module with ``add_parser`` and ``execute``."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from robot.errors import KeyholeError
from server.version import version

COMMANDS = {
    "console": "server.commands.console",
    "run": "server.commands.run",
    "calibrate": "server.commands.calibrate",
    "replay": "server.commands.replay",
    "study": "server.commands.study",
    "report": "server.commands.report",
    "bench": "benchmarks.command",
    "doctor": "server.commands.doctor",
    "fake-arm": "server.commands.fake_arm",
    "fake-servos": "server.commands.fake_servos",
    "stop": "server.commands.stop",
    "fake-stylus": "server.commands.fake_stylus",
    "faults": "server.commands.faults",
    "soak": "server.commands.soak",
    "states": "server.commands.states",
}
"""Subcommands and their modules: ``add_parser(subparsers)`` and ``execute(arguments) -> int``."""

_DEFAULT = "console"
_REFUSED = 2
_INTERRUPTED = 130
_TOP_LEVEL = ("-h", "--help", "--version")


class _Parser(argparse.ArgumentParser):
    """A parser that refuses in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(_REFUSED, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _parser(modules: dict[str, Any]) -> argparse.ArgumentParser:
    parser = _Parser(
        prog="keyhole",
        description="A web console for teleoperating continuum instruments through a keyhole.",
        epilog="Without a command the console starts; its options may then stand alone.",
    )
    parser.add_argument("--version", action="version", version=f"keyhole {version()}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)
    for module in modules.values():
        module.add_parser(subparsers)
    return parser


def _with_default(arguments: Sequence[str]) -> list[str]:
    """Put the default command in front where only its options were given."""
    if not arguments or (arguments[0].startswith("-") and arguments[0] not in _TOP_LEVEL):
        return [_DEFAULT, *arguments]
    return list(arguments)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: the arguments after the program's name; None for those of the process.

    Returns:
        The exit status: 2 with one line on stderr for whatever is refused.
    """
    arguments = _with_default(sys.argv[1:] if argv is None else argv)
    # Only what is asked for is imported, or every start would pay for every command.
    wanted = arguments[:1] if arguments[0] in COMMANDS else list(COMMANDS)
    modules = {name: importlib.import_module(COMMANDS[name]) for name in wanted}
    try:
        chosen = _parser(modules).parse_args(arguments)
    except SystemExit as exit_request:
        return int(exit_request.code or 0)
    try:
        return int(modules[chosen.command].execute(chosen))
    except KeyholeError as error:
        print(f"keyhole: {' '.join(str(error).split())}", file=sys.stderr)
        return _REFUSED
    except KeyboardInterrupt:
        return _INTERRUPTED
    except BrokenPipeError:
        # The reader of a pipe has seen enough; the interpreter must not complain at its end.
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
