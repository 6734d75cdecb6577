"""``keyhole stop``: an emergency stop that needs neither page nor network nor web process."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from robot.errors import KeyholeError

_NOT_CONFIRMED = 1
_PATIENCE_S = 2.0


class NothingToStop(KeyholeError):
    """No control process can be reached.

    Attributes:
        directory: the run directory that was looked into.
    """

    code = "nothing_to_stop"

    def __init__(self, directory: Path, detail: str) -> None:
        super().__init__(f"nothing was stopped: {detail}; use the stop on the machine")
        self.directory = directory


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``stop`` to the command line."""
    parser = subparsers.add_parser("stop", help="stop the robot of the console that runs here")
    parser.add_argument(
        "--run-directory",
        metavar="DIR",
        type=Path,
        help="of the console, where it was started with one",
    )


def execute(arguments: argparse.Namespace) -> int:
    """Order control to stop, and wait until its records say that it did.

    Returns:
        0 when the robot holds in FAULT, 1 when that was not seen in time.

    Raises:
        NothingToStop: there is no console, it shows a recording, or its control process is down.
    """
    from robot.record_types import record_types_of
    from server.audit.writer import AuditLog
    from server.memory.link_records import RECORD_SLOT_FILE
    from server.memory.mapped import MappedSlot
    from server.memory.run_directory import RunDirectory, default_path
    from server.supervision.stop_order import StopOrder

    path = arguments.run_directory or default_path()
    pid = int(_supervision(path)["control_pid"][0])
    _check_alive(path, pid)
    types = record_types_of(RunDirectory(path).configuration())
    order = StopOrder(MappedSlot(path / RECORD_SLOT_FILE, types.record))
    if not order.send(pid):
        raise NothingToStop(path, "the control process has just ended")
    took_ms = order.wait(_PATIENCE_S)
    words = "emergency stop: the control process was told, and does not confirm it"
    if took_ms is not None:
        words = f"emergency stop: the robot holds in FAULT after {took_ms:.1f} ms"
    print(f"keyhole: {words}" + ("; use the stop on the machine" if took_ms is None else ""))
    audit = AuditLog.of_console("stop", path)
    audit.note("emergency_stop", words, by="keyhole stop", user=os.getuid(), took_ms=took_ms)
    audit.close()
    return 0 if took_ms is not None else _NOT_CONFIRMED


def _supervision(path: Path) -> NDArray[Any]:
    """What the supervisor of the console there said last."""
    from server.memory.link_records import SUPERVISION, SUPERVISION_FILE
    from server.memory.mapped import MappedFileError, MappedReadError, MappedSlot
    from server.memory.replay_link import ReplayLink

    try:
        if ReplayLink.is_in(path):
            raise NothingToStop(path, f"the console in {path} shows a recording")
        return MappedSlot(path / SUPERVISION_FILE, SUPERVISION).read()
    except (MappedFileError, MappedReadError):
        detail = f"no console runs in {path}; name its --run-directory if it has its own"
        raise NothingToStop(path, detail) from None


def _check_alive(path: Path, pid: int) -> None:
    """Make sure that the id is the control process': another might have it by now."""
    from server.memory.run_directory import RunDirectory

    lock = RunDirectory(path).lock_control()
    if lock is not None:
        os.close(lock)
    if lock is not None or pid <= 0:
        raise NothingToStop(path, "the control process is down, and commands nothing")
