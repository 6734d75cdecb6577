"""``keyhole console``: the whole console in one command."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import time
import webbrowser
from pathlib import Path

from robot.errors import UnknownName
from server.version import version

ROBOTS = ("instrument",)


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``console`` to the command line."""
    parser = subparsers.add_parser("console", help="start the console (also without a command)")
    parser.add_argument("--host", help="address to listen on (default: from the configuration)")
    parser.add_argument("--port", type=_port, help="port to listen on; 0 takes a free one")
    parser.add_argument("--robot", default=ROBOTS[0], help=f"one of: {', '.join(ROBOTS)}")
    parser.add_argument("--no-browser", action="store_true", help="do not open a browser")
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")
    parser.add_argument(
        "--run-directory",
        metavar="DIR",
        type=Path,
        help="private folder of this console; a second console needs its own",
    )


def _port(text: str) -> int:
    try:
        port = int(text)
    except ValueError:
        port = -1
    if not 0 <= port <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port; give a number from 0 to 65535")
    return port


def execute(arguments: argparse.Namespace) -> int:
    """Run the console until it is told to end.

    Returns:
        0 after an orderly end, 2 when the control process refused to start.

    Raises:
        KeyholeError: something stands against the start; nothing was started.
    """
    from server.configuration_file import load
    from server.memory.run_directory import RunDirectory, default_path
    from server.supervision.listener import address_of, is_loopback, listen
    from server.supervision.supervisor import Supervisor, say

    if arguments.robot not in ROBOTS:
        raise UnknownName("robot", arguments.robot, ROBOTS)
    configuration = load(arguments.config)
    host = configuration.server.host if arguments.host is None else arguments.host
    port = configuration.server.port if arguments.port is None else arguments.port
    directory = RunDirectory.take(arguments.run_directory or default_path())
    try:
        with listen(host, port) as listener:
            address = address_of(host, listener)
            directory.write_configuration(configuration)
            directory.write_console(
                {
                    "pid": os.getpid(),
                    "host": host,
                    "port": listener.getsockname()[1],
                    "address": address,
                    "robot": arguments.robot,
                    "started_ns": time.time_ns(),
                }
            )
            url = f"{address}?token={directory.new_token()}"
            supervisor = Supervisor(directory, configuration, listener)
            _announce(url)
            if not is_loopback(listener):
                say(
                    f"warning: listening on {host}: whoever on the network has the address above "
                    "can drive the robot, and what they send is not encrypted"
                )
            if not arguments.no_browser:
                _open_browser(url)
            return supervisor.run()
    finally:
        directory.give_back()


def _announce(url: str) -> None:
    print(f"Keyhole {version()}: {url}", flush=True)
    print("Open this address in a browser; it is private to you. Ctrl+C ends the console.")
    sys.stdout.flush()


def _open_browser(url: str) -> None:
    """Open the page where there is a screen; elsewhere a text browser would take the terminal."""
    on_screen = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if on_screen or sys.platform == "darwin":
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
