"""``keyhole faults``: break a console in every way that was thought of, and measure."""

from __future__ import annotations

import argparse
import json
import signal
from pathlib import Path

from server.commands.progress_bar import ProgressBar


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``faults`` to the command line."""
    parser = subparsers.add_parser(
        "faults",
        help="inject every known fault into a console and measure what it does",
        description="Starts consoles of its own, breaks them, and drives them again.",
    )
    parser.add_argument("--json", metavar="FILE", help="write the table there; - for stdout")
    parser.add_argument("--only", metavar="NAME[,NAME]", default="", help="these faults only")
    parser.add_argument("--list", action="store_true", help="name the faults and end")
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")


def execute(arguments: argparse.Namespace) -> int:
    """Measure and print.

    Returns:
        0 where everything is as demanded, 1 where it is not.
    """
    from server.configuration_file import load
    from server.faults.table import FAULTS, chosen, printed, run

    if arguments.list:
        for fault in FAULTS:
            print(f"{fault.group.value:<8} {fault.name:<28} {fault.title}")
        return 0
    faults = chosen([name for name in arguments.only.split(",") if name])
    # Consoles and simulators end with us, however we are told to.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    bar = ProgressBar("faults")

    def progress(share: float, name: str) -> None:
        bar.title = f"{name:<28}"
        bar(share)

    document = run(faults, load(arguments.config), progress)
    bar.end()
    text = json.dumps(document, indent=2, allow_nan=False)
    if arguments.json == "-":
        print(text)
    else:
        print(printed(document))
        if arguments.json:
            Path(arguments.json).write_text(text + "\n", encoding="utf-8")
    return 0 if document["met"] else 1
