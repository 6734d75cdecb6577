"""``keyhole soak``: drive for a long time while one thing after the other breaks."""

from __future__ import annotations

import argparse
import json
import signal
from pathlib import Path

from server.commands.progress_bar import ProgressBar


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``soak`` to the command line."""
    parser = subparsers.add_parser(
        "soak",
        help="drive for minutes while random faults happen",
        description="A console with simulated servos and stylus; the same seed, the same faults.",
    )
    parser.add_argument("--minutes", type=_minutes, default=10.0, help="how long (default: 10)")
    parser.add_argument("--seed", type=int, default=1, help="which faults, and when (default: 1)")
    parser.add_argument("--json", metavar="FILE", help="write what was found; - for stdout")
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")


def _minutes(text: str) -> float:
    try:
        minutes = float(text)
    except ValueError:
        minutes = -1.0
    if not 0.0 < minutes <= 10_000.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no length in minutes")
    return minutes


def execute(arguments: argparse.Namespace) -> int:
    """Run and print.

    Returns:
        0 where everything holds, 1 where it does not.
    """
    from server.configuration_file import load
    from server.faults.soak import printed, run

    # Consoles and simulators end with us, however we are told to.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    bar = ProgressBar("soak")

    def progress(share: float, name: str) -> None:
        bar.title = f"{name:<28}"
        bar(share)

    document = run(60.0 * arguments.minutes, arguments.seed, load(arguments.config), progress)
    bar.end()
    text = json.dumps(document, indent=2, allow_nan=False)
    if arguments.json == "-":
        print(text)
    else:
        print(printed(document))
        if arguments.json:
            Path(arguments.json).write_text(text + "\n", encoding="utf-8")
    return 0 if document["met"] else 1
