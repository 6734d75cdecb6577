"""What ``keyhole run`` refuses before it begins, whichever robot it runs."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

from robot.errors import KeyholeError


class RunArgumentError(KeyholeError):
    """What was asked of ``keyhole run`` cannot be done."""

    code = "run_argument"


def check_writable(name: str | None) -> None:
    """Refuse before the run what could not be written after it."""
    if name is None or name == "-":
        return
    try:
        with open(name, "a"):
            pass
    except OSError as error:
        raise RunArgumentError(f"{name} cannot be written: {error.strerror}") from None


def text_of(name: str) -> str:
    """Contents of the file called ``name``; raises ``RunArgumentError`` where it is no text."""
    try:
        return Path(name).read_text()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not text (UTF-8)"
        raise RunArgumentError(f"{name}: {reason}") from None


def refuse_options(arguments: argparse.Namespace, options: Iterable[str], why: str) -> None:
    """Refuse the first of ``options`` that the command line gives."""
    for option in options:
        value = getattr(arguments, option)
        if value is not None and value is not False:
            given = option.replace("_", "-")
            raise RunArgumentError(f"--{given} does not belong here: {why}; leave it out")
