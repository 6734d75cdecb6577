"""``keyhole fake-stylus``: a stylus that plays a path, behind a rosbridge or at our WebSocket."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from server.fake_stylus.faults import KNOWN

if TYPE_CHECKING:
    from server.fake_stylus.program import Outlet

_BUTTONS = {"first": 1, "second": 2, "both": 3}


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``fake-stylus`` to the command line."""
    names = "\n".join(f"  {name:<19} {known.meaning}" for name, known in KNOWN.items())
    parser = subparsers.add_parser(
        "fake-stylus",
        help="simulate a haptic stylus at 500 Hz",
        description="Plays a path as a stylus would, as a rosbridge or as a client of the console.",
        epilog="faults, separated by commas, as NAME[:KEY=VALUE]... with the keys\n"
        "times (0: until cleared), for_ms, delay_ms, value:\n" + names,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--path", default="circle", help="an experiment's name, or a CSV file (default: circle)"
    )
    parser.add_argument(
        "--listen",
        metavar="URL",
        help="be a rosbridge there; by default where the configuration looks for one",
    )
    parser.add_argument("--to", metavar="URL", help="be a client of this console's own WebSocket")
    parser.add_argument("--token", default="", help="of that console")
    parser.add_argument("--lease", default="", metavar="ID", help="the lease under which to lead")
    parser.add_argument(
        "--operator", default="", metavar="NAME", help="take the lease, and renew it"
    )
    parser.add_argument("--buttons", choices=_BUTTONS, default="first", help="which are pressed")
    parser.add_argument(
        "--manual", action="store_true", help="press only when the control channel says so"
    )
    parser.add_argument(
        "--on-change", action="store_true", help="tell the buttons only when they change"
    )
    parser.add_argument(
        "--control",
        type=Path,
        default=Path("/tmp/keyhole-stylus.control"),
        help="name of the control channel, a local socket",
    )
    parser.add_argument("--faults", default="", metavar="NAME[,NAME]", help="see below")
    parser.add_argument("--config", type=Path, help="configuration file: topics and address")


def execute(arguments: argparse.Namespace) -> int:
    """Play until SIGINT or SIGTERM.

    Returns:
        0.

    Raises:
        KeyholeError: an option makes no sense, or the other end does not let us.
    """
    from server.commands.stop_signals import StopSignals
    from server.configuration_file import load
    from server.fake_stylus.device import FakeStylus, named_path, places_of
    from server.fake_stylus.program import RATE_HZ, Options, serve

    configuration = load(arguments.config)
    places = places_of(named_path(arguments.path, configuration), RATE_HZ)
    bits = _BUTTONS[arguments.buttons]
    stylus = FakeStylus(places, RATE_HZ, bits, automatic=not arguments.manual)
    outlet, where = _outlet(arguments)
    options = Options(
        control=arguments.control.absolute(),
        faults=arguments.faults,
        repeats_buttons=not arguments.on_change,
    )
    with StopSignals() as signals:
        print(f"fake stylus {where}, control channel at {options.control}", flush=True)
        serve(stylus, outlet, options, signals.received)
    return 0


def _outlet(arguments: argparse.Namespace) -> tuple[Outlet, str]:
    from server.configuration_file import load
    from server.fake_stylus.outlets import ConsoleClient, RosbridgeServer, take_lease
    from server.fake_stylus.wording import RosWording

    if arguments.to is None:
        stylus = load(arguments.config).stylus
        wording = RosWording(stylus.pose_topic, stylus.buttons_topic)
        server = RosbridgeServer(arguments.listen or stylus.url, wording)
        return server, f"behind a rosbridge at {server.address}"
    base = arguments.to.partition("/?")[0].rstrip("/")
    lease = arguments.lease
    if arguments.operator:
        lease = take_lease(base, arguments.token, arguments.operator)
        print(f"lease: {lease}", flush=True)
    client = ConsoleClient(base, arguments.token, lease, renews=bool(arguments.operator))
    return client, f"at {base}"
