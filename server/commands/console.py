"""``keyhole console``: the whole console in one command."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import time
import webbrowser
from pathlib import Path
from typing import get_args

from robot.concentric.design import METHODS
from robot.configuration import Compensation, Configuration, Hardware, Simulation
from robot.errors import UnknownName
from robot.section import Section
from robot.tension.design import Tendons
from server.version import version

ROBOTS = ("instrument", "concentric", "hardware")
"""The simulated instrument, simulated concentric-tube arms, the instrument with real parts."""

ARMS = get_args(Hardware.model_fields["arm"].annotation)

_SECTIONS: dict[str, type[Section]] = {
    "simulation": Simulation,
    "compensation": Compensation,
    "tendons": Tendons,
}
_SIMULATED = {
    "plant": ("simulation", "plant"),
    "preset": ("simulation", "preset"),
    "actuation": ("simulation", "actuation"),
    "board": ("simulation", "board"),
    "compensation": ("compensation", "mode"),
    "tendons": ("tendons", "control"),
}
_HELP = {
    "plant": "the robot",
    "preset": "how good the simulated robot is",
    "actuation": "what drives the tendons of the simulated robot",
    "board": "what stands before the instrument",
    "compensation": "how stretch and friction of the tendons are met",
    "tendons": "what the drives of the tendons hold",
}


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``console`` to the command line."""
    parser = subparsers.add_parser("console", help="start the console (also without a command)")
    add_page_arguments(parser)
    parser.add_argument("--robot", help=f"one of: {', '.join(ROBOTS)}; else as configured")
    parser.add_argument("--method", choices=METHODS, help="of the concentric-tube arms")
    parser.add_argument("--start", type=int, help="in which of its starts that robot wakes up")
    parser.add_argument("--servos", metavar="PORT", help="of the servo bus (--robot hardware)")
    parser.add_argument("--arm", choices=ARMS, help="which arm carries the servos")
    parser.add_argument("--stylus", metavar="URL", help="of the rosbridge behind a haptic stylus")
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")
    for flag, (table, key) in _SIMULATED.items():
        choices = get_args(_SECTIONS[table].model_fields[key].annotation)
        parser.add_argument(f"--{flag}", choices=choices, help=_HELP[flag])
    parser.add_argument("--seed", type=_seed, help="draws what differs between robots of a preset")
    parser.add_argument("--tracker", choices=("on", "off"), help="whether a tip tracker is used")
    parser.add_argument(
        "--record",
        metavar="FILE",
        nargs="?",
        const="",
        help="record from the start; without a name, into the folder of recordings",
    )


def add_page_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what says where the page is served, and whether it is opened."""
    parser.add_argument("--host", help="address to listen on (default: from the configuration)")
    parser.add_argument("--port", type=_port, help="port to listen on; 0 takes a free one")
    parser.add_argument("--no-browser", action="store_true", help="do not open a browser")
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


def _seed(text: str) -> int:
    try:
        seed = int(text)
    except ValueError:
        seed = -1
    if not 0 <= seed < 2**31:
        raise argparse.ArgumentTypeError(f"{text!r} is not a seed; give a whole number from 0 on")
    return seed


def configured(configuration: Configuration, arguments: argparse.Namespace) -> Configuration:
    """The configuration with what the command line chooses in its place."""
    chosen: dict[str, dict[str, object]] = {name: {} for name in (*_SECTIONS, "tracker")}
    for flag, (table, key) in _SIMULATED.items():
        if getattr(arguments, flag) is not None:
            chosen[table][key] = getattr(arguments, flag)
    if arguments.seed is not None:
        chosen["simulation"]["seed"] = arguments.seed
    chosen["hardware"] = {"connected": True} if arguments.robot == "hardware" else {}
    chosen["concentric"] = {
        name: getattr(arguments, name)
        for name in ("method", "start")
        if getattr(arguments, name) is not None
    }
    chosen["servos"], chosen["stylus"] = {}, {}
    if arguments.servos is not None:
        chosen["servos"]["port"] = arguments.servos
    if arguments.arm is not None:
        chosen["hardware"]["arm"] = arguments.arm
    if arguments.stylus is not None:
        chosen["stylus"] = {"source": "rosbridge", "url": arguments.stylus}
    if arguments.tracker is not None:
        chosen["tracker"]["enabled"] = arguments.tracker == "on"
    sections = {
        table: getattr(configuration, table).model_copy(update=values)
        for table, values in chosen.items()
    }
    if arguments.robot is not None:
        robot = "instrument" if arguments.robot == "hardware" else arguments.robot
        return configuration.model_copy(update={**sections, "robot": robot})
    return configuration.model_copy(update=sections)


def _check_robot(arguments: argparse.Namespace, configuration: Configuration) -> None:
    """Refuse a robot or a start that does not exist.

    Raises:
        UnknownName: there is none of that name or number.
    """
    if arguments.robot not in (None, *ROBOTS):
        raise UnknownName("robot", arguments.robot, ROBOTS)
    starts = tuple(str(number) for number in range(1, len(configuration.concentric.starts) + 1))
    if arguments.start is not None and str(arguments.start) not in starts:
        raise UnknownName("start", arguments.start, starts)


def execute(arguments: argparse.Namespace) -> int:
    """Run the console until it is told to end.

    Returns:
        0 after an orderly end, 2 when the control process refused to start.

    Raises:
        KeyholeError: something stands against the start; nothing was started.
    """
    from robot.tension.feasibility import check_configured
    from server.configuration_file import load

    configuration = load(arguments.config)
    _check_robot(arguments, configuration)
    chosen = configured(configuration, arguments)
    check_configured(chosen)
    return serve(arguments, chosen, record=_recording_path(arguments.record))


def _recording_path(wanted: str | None) -> Path | None:
    """Where to record from the start; None for not at all.

    Raises:
        RecordingNotWritten: no recording can be made there.
    """
    if wanted is None:
        return None
    from server.recording.folder import check_new, named

    return check_new(Path(wanted).absolute() if wanted else named())


def serve(
    arguments: argparse.Namespace,
    configuration: Configuration,
    *,
    replay: Path | None = None,
    record: Path | None = None,
) -> int:
    """Run the processes of a console until it is told to end.

    Args:
        arguments: those of :func:`add_page_arguments`.
        configuration: of the robot.
        replay: a recording to show in place of a robot.
        record: a file to record into from the start.

    Returns:
        0 after an orderly end, 2 when the control process refused to start.

    Raises:
        KeyholeError: something stands against the start; nothing was started.
    """
    from server.audit.folder import folder
    from server.audit.writer import AuditLog
    from server.memory.run_directory import RunDirectory, default_path
    from server.supervision.listener import address_of, is_loopback, listen
    from server.supervision.supervisor import Supervisor, say
    from server.supervision.terminal import Terminal

    host = configuration.server.host if arguments.host is None else arguments.host
    port = configuration.server.port if arguments.port is None else arguments.port
    directory = RunDirectory.take(arguments.run_directory or default_path())
    started_ns = time.time_ns()
    audit = AuditLog("supervisor", folder(), str(started_ns))
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
                    "robot": configuration.robot,
                    "started_ns": started_ns,
                }
            )
            url = f"{address}?token={directory.new_token()}"
            terminal = Terminal.of_this_process()
            supervisor = Supervisor(
                directory, configuration, listener,
                replay=replay, record=record, audit=audit, terminal=terminal,
            )  # fmt: skip
            _announce(url, stops=terminal.is_there and replay is None)
            audit.note("console_started", f"the console was started at {address}", address=address)
            if not is_loopback(listener):
                say(
                    f"warning: listening on {host}: whoever on the network has the address above "
                    "can drive the robot, and what they send is not encrypted"
                )
            if not arguments.no_browser:
                _open_browser(url)
            status = supervisor.run()
            audit.note("console_ended", f"the console ended with status {status}", status=status)
            return status
    finally:
        audit.close()
        directory.give_back()


def _announce(url: str, stops: bool) -> None:
    print(f"Keyhole {version()}: {url}", flush=True)
    print("Open this address in a browser; it is private to you. Ctrl+C ends the console.")
    if stops:
        print("Enter in this terminal is an emergency stop, whatever the page does.")
    sys.stdout.flush()


def _open_browser(url: str) -> None:
    """Open the page where there is a screen; elsewhere a text browser would take the terminal."""
    on_screen = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if on_screen or sys.platform == "darwin":
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
