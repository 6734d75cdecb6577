"""``keyhole replay``: shows a recording in the console, or checks it tick by tick."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from server.commands.console import add_page_arguments

_DIFFERS = 1


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``replay`` to the command line."""
    parser = subparsers.add_parser("replay", help="show a recording, or check it")
    parser.add_argument("file", metavar="FILE", type=Path, help="a recording (MCAP)")
    parser.add_argument(
        "--verify",
        action="store_true",
        help="feed the recorded inputs through the controller and compare bit for bit",
    )
    add_page_arguments(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Show or check the recording.

    Returns:
        0 after an orderly end, or when every tick is the same; 1 when a tick differs; 2 when the
        replay could not start.

    Raises:
        KeyholeError: the file is not a recording that can be read; nothing was started.
    """
    if arguments.verify:
        return _verify(arguments.file)
    from server.commands.console import serve
    from server.configuration_file import load
    from server.recording.reader import Recording

    path = arguments.file.absolute()
    with Recording(path) as recording:
        recorded = recording.configuration()
    # Where the page is served is no matter of the recording, which may come from anybody.
    configuration = recorded.model_copy(update={"server": load().server})
    return serve(arguments, configuration, replay=path)


def _verify(path: Path) -> int:
    from server.commands.progress_bar import ProgressBar
    from server.recording.reader import Recording
    from server.recording.verify import report, verify

    with Recording(path) as recording:
        bar = ProgressBar("verify")
        result = verify(recording, bar)
        bar.end()
        print(report(recording, result))
    sys.stdout.flush()
    return _DIFFERS if result.differing else 0
