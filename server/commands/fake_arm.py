"""``keyhole fake-arm``: an xArm 7's controller that the vendor's own library connects to."""

from __future__ import annotations

import argparse
from pathlib import Path

from hardware.fake_arm.faults import FAULTS


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``fake-arm`` to the command line."""
    names = "\n".join(f"  {name:<15} {fault.meaning}" for name, fault in FAULTS.items())
    parser = subparsers.add_parser(
        "fake-arm",
        help="simulate an xArm 7's controller on loopback",
        description="Commands and reports as an xArm 7's controller has them, for its vendor's "
        "library and for arm_address. It stands at the configured start.",
        epilog="faults, separated by commas, as NAME[:after_ms=N][:for_ms=N]:\n" + names,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--listen",
        default="127.0.0.1:5020",
        metavar="ADDRESS[:PORT]",
        help="where commands are taken, port 502 if none is given; reports come from 30001 to "
        "30003 (default: %(default)s)",
    )
    parser.add_argument(
        "--control",
        type=Path,
        default=Path("/tmp/keyhole-arm.control"),
        help="name of the control channel, a local socket",
    )
    parser.add_argument("--faults", default="", metavar="NAME[,NAME]", help="see below")
    parser.add_argument("--config", type=Path, help="configuration file: joint limits and start")


def execute(arguments: argparse.Namespace) -> int:
    """Simulate until SIGINT or SIGTERM.

    Returns:
        0.

    Raises:
        KeyholeError: an option makes no sense, or a port is taken.
    """
    import numpy as np

    from hardware.arm.address import arm_address
    from hardware.fake_arm.controller import Controller
    from hardware.fake_arm.faults import wanted_faults
    from hardware.fake_arm.program import FakeArm
    from robot.instrument_robot import InstrumentRobot
    from server.commands.stop_signals import StopSignals
    from server.configuration_file import load

    address, faults = arm_address(arguments.listen), wanted_faults(arguments.faults)
    configuration = load(arguments.config)
    joints = configuration.arm.joints
    controller = Controller(
        InstrumentRobot(configuration).initial_state()["x"][0][: len(joints)],
        np.array([joint.lower_rad for joint in joints]),
        np.array([joint.upper_rad for joint in joints]),
    )
    with StopSignals() as signals:
        fake = FakeArm(controller, address, arguments.control, faults)
        try:
            print(f"fake arm at {address}, control channel at {arguments.control}", flush=True)
            fake.run(signals.received, realtime=True)
        finally:
            fake.close()
    return 0
