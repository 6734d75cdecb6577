"""The control process: the only loop, the safety state, and the plant.

It outlives the web process, and ends in order (the plant holds, then closes) when it is asked to,
when its supervisor is gone, or when the loop fails. In an ordinary tick it touches mapped memory
only, never a file.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.record_types import record_types_of
from server.control.lifeline import Lifeline
from server.memory.control_link import ControlLink
from server.memory.link_records import STATUS, Phase
from server.memory.run_directory import RunDirectory

if TYPE_CHECKING:
    from server.control.runner import ControlRunner

_LOCK_PATIENCE_S = 10.0


class ControlBusy(KeyholeError):
    """Another control process still drives the robot of this run directory."""

    code = "control_busy"


class Status:
    """What the control process says of itself where something changes.

    Args:
        link: where it is published.
        rate_hz: the loop's rate.
    """

    def __init__(self, link: ControlLink, rate_hz: float) -> None:
        self._link = link
        self._record: NDArray[Any] = np.zeros(1, dtype=STATUS)
        self._record["pid"], self._record["rate_hz"] = os.getpid(), rate_hz

    def say(self, phase: Phase, message: str, **more: str) -> None:
        """Publish the phase, a message for people, and ``realtime`` or ``plant`` where given."""
        self._record["phase"] = int(phase)
        for name, text in {"message": message, **more}.items():
            self._record[name] = text.encode()
        self._write()

    def show(self, surroundings: dict[str, Any]) -> None:
        """Publish where the trocar is registered, how it breathes, and which board is there."""
        for name, value in surroundings.items():
            self._record[name] = value.encode() if isinstance(value, str) else value
        self._write()

    def _write(self) -> None:
        self._record["stamp_ns"] = time.monotonic_ns()
        self._link.write_status(self._record)


def _lock(directory: RunDirectory) -> int:
    """Wait for a control process that is still ending; returns the lock's descriptor."""
    give_up = time.monotonic() + _LOCK_PATIENCE_S
    while True:
        lock = directory.lock_control()
        if lock is not None:
            return lock
        if time.monotonic() > give_up:
            raise ControlBusy("the control process of an earlier console still drives the robot")
        time.sleep(0.05)


def _run(directory: RunDirectory, configuration: Configuration, lifeline: Lifeline) -> int:
    link = ControlLink(directory.path, record_types_of(configuration))
    status = Status(link, configuration.rate_hz)
    status.say(Phase.STARTING, "loading the controller")
    from server.control import realtime
    from server.control.make_loop import make_loop
    from server.control.runner import ControlRunner

    loop = make_loop(directory, configuration, partial(status.say, Phase.STARTING))
    try:
        runner = ControlRunner(
            loop, link, lifeline, configuration.rate_hz, lambda: status.show(loop.surroundings())
        )
        status.show(loop.surroundings())
        signal.signal(signal.SIGTERM, lambda *_: runner.stop())
        signal.signal(signal.SIGUSR1, lambda *_: runner.emergency_stop())
        words = realtime.enter(configuration.control.realtime)
        status.say(Phase.RUNNING, "running", realtime=words, plant=loop.plant.spec.name)
        return drive(runner, status)
    finally:
        loop.plant.close()


def drive(runner: ControlRunner, status: Status) -> int:
    """Run the loop to its end, whichever that is; returns the exit status."""
    try:
        runner.run()
    except Exception as error:
        # Whatever failed, the robot must hold, and others must learn of it.
        place = traceback.extract_tb(error.__traceback__)[-1]
        cause = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        with contextlib.suppress(Exception):
            runner.fail()
        status.say(Phase.FAILED, f"the control loop failed: {cause}")
        _say(f"the control loop failed and the robot holds: {cause}")
        return 1
    status.say(Phase.ENDED, "ended")
    return 0


def _say(message: str) -> None:
    print(f"keyhole control: {' '.join(message.split())}", file=sys.stderr, flush=True)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: ``python -m server.control.process --run-directory DIR [--lifeline-fd N]``.

    Returns:
        0 when it was asked to end, 1 when the loop failed, 2 when it could not start.
    """
    parser = argparse.ArgumentParser(prog="keyhole control")
    parser.add_argument("--run-directory", required=True, type=Path)
    parser.add_argument("--lifeline-fd", type=int)
    arguments = parser.parse_args(argv)
    for ignored in (signal.SIGINT, signal.SIGHUP, signal.SIGUSR1):
        # The supervisor gets the first two, and ends everything in order; the last one stops
        # motion, of which there is none yet.
        signal.signal(ignored, signal.SIG_IGN)
    try:
        directory = RunDirectory(arguments.run_directory)
        configuration = directory.configuration()
        lock = _lock(directory)
        try:
            return _run(directory, configuration, Lifeline(arguments.lifeline_fd))
        finally:
            os.close(lock)
    except KeyholeError as error:
        _say(str(error))
        return 2


if __name__ == "__main__":
    sys.exit(main())
