"""``keyhole fake-servos``: XL430 servos on a pseudo-terminal, for any driver."""

from __future__ import annotations

import argparse
from pathlib import Path

from hardware.fake_servos.faults import KNOWN

_BAUD_RATES = (9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``fake-servos`` to the command line."""
    names = "\n".join(f"  {name:<15} {known.meaning}" for name, known in KNOWN.items())
    parser = subparsers.add_parser(
        "fake-servos",
        help="simulate servos on a pseudo-terminal",
        description="Byte-exact XL430-W250 servos at a port of their own, pulling on a segment.",
        epilog="faults, separated by commas, as NAME[:KEY=VALUE]... with the keys\n"
        "servo (id), times (0: until cleared), after, delay_ms, for_ms, value:\n" + names,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--link", type=Path, default=Path("/tmp/keyhole-servos"), help="name of the port"
    )
    parser.add_argument(
        "--baud",
        type=int,
        default=1_000_000,
        choices=_BAUD_RATES,
        help="what the servos are set to",
    )
    parser.add_argument(
        "--ids", default="101..104", help="ids in the order of the tendons: 101..104 or 1,2,3,4"
    )
    parser.add_argument(
        "--directions", default="1,1,1,1", help="-1 for a servo that pulls toward larger ticks"
    )
    parser.add_argument(
        "--slack-mm", default="0.8,1.2,1.0,0.6", help="of each tendon at first; negative: taut"
    )
    parser.add_argument("--return-delay-us", type=int, default=500, help="register 9 at first")
    parser.add_argument(
        "--adapter-ms", type=float, default=0.0, help="latency of the simulated USB adapter"
    )
    parser.add_argument("--faults", default="", metavar="NAME[,NAME]", help="see below")
    parser.add_argument("--config", type=Path, help="configuration file: dimensions of the module")


def execute(arguments: argparse.Namespace) -> int:
    """Simulate until SIGINT or SIGTERM.

    Returns:
        0.

    Raises:
        KeyholeError: an option makes no sense, or the port's name is taken.
    """
    from hardware.fake_servos.program import Options, serve
    from hardware.fake_servos.simulation import Mounting
    from hardware.fake_servos.tendons import SegmentShape
    from server.commands.stop_signals import StopSignals
    from server.configuration_file import load

    configuration = load(arguments.config)
    shape = SegmentShape(
        pitch_radius_m=configuration.instrument.tendon_pitch_radius_m,
        pulley_radius_m=configuration.module.pulley_radius_m,
        length_m=configuration.instrument.segment_length_m,
    )
    mounting = Mounting(
        ids=_ids(arguments.ids),
        baud_rate=arguments.baud,
        directions=tuple(int(sign) for sign in _numbers("--directions", arguments.directions, 4)),
        slack_m=tuple(1e-3 * slack for slack in _numbers("--slack-mm", arguments.slack_mm, 4)),
        shape=shape,
    )
    options = Options(
        link=arguments.link.absolute(),
        mounting=mounting,
        faults=arguments.faults,
        adapter_ms=arguments.adapter_ms,
        return_delay_us=arguments.return_delay_us,
    )
    with StopSignals() as signals:
        serve(options, signals.received, lambda line: print(line, flush=True))
    return 0


def _numbers(option: str, text: str, count: int) -> list[float]:
    from hardware.control_channel import BadFault

    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        raise BadFault(option, f"{text!r} is not {count} numbers with commas between them")
    return values


def _ids(text: str) -> tuple[int, ...]:
    from hardware.control_channel import BadFault

    first, dots, last = text.partition("..")
    try:
        ids = range(int(first), int(last) + 1) if dots else [int(p) for p in text.split(",")]
    except ValueError:
        ids = []
    if not ids or len(set(ids)) != len(ids) or not all(0 <= number <= 252 for number in ids):
        raise BadFault("--ids", f"{text!r} is neither FIRST..LAST nor different ids from 0 to 252")
    return tuple(ids)
