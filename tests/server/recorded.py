"""Recordings for the tests: a short run of the real loop, written to real files."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.kinematic_plant import KinematicPlant
from robot.calibration import Calibration
from robot.instrument_robot import InstrumentRobot
from robot.records import LeaderKind, Request
from scenes.experiments import experiment
from server.configuration_file import load
from server.control.instrument_loop import InstrumentLoop
from server.recording.writer import RecordingWriter

Records = NDArray[Any]

CALIBRATION = Calibration(gain=(0.9, 0.95), robot="of the tests")


class Session:
    """A loop that is stepped, and the records of all its steps."""

    def __init__(self) -> None:
        configuration = load()
        robot = InstrumentRobot(configuration, CALIBRATION)
        plant = KinematicPlant(configuration, robot.initial_state()["x"][0])
        self.loop = InstrumentLoop(robot, plant, configuration)
        self.loop.hold = 1
        self.records: list[Records] = []

    def step(self, count: int, request: Request = Request.NONE) -> None:
        """Step, with a request in the first of the steps."""
        self.loop.request = request
        for _ in range(count):
            self.loop.step()
            self.records.append(self.loop.record.copy())


@functools.cache
def recorded_run() -> Records:
    """(600,) RECORD: a path, a pause, another priority, a pulled gizmo, an emergency stop."""
    session = Session()
    loop = session.loop
    session.step(50)
    session.step(1, Request.ENABLE)
    loop.start_path(experiment("circle", load()).path)
    session.step(199)
    session.step(20, Request.PAUSE)
    loop.stop_path()
    loop.settings["case"] = 2
    session.step(30, Request.ENABLE)
    leader = loop.leader
    leader["kind"], leader["clutch"], leader["timeout_s"] = LeaderKind.GIZMO, 1, 1.0
    leader["wxyz"], leader["smoothing_s"] = (1.0, 0.0, 0.0, 0.0), 0.05
    for _ in range(200):
        leader["sequence"] += 1
        leader["position"] += (2e-5, 1e-5, 0.0)
        session.step(1)
    session.step(60, Request.EMERGENCY_STOP)
    session.step(40, Request.RESET)
    return np.concatenate(session.records)


def write(
    path: Path, records: Records, change: Callable[[RecordingWriter], None] | None = None
) -> None:
    """Record into ``path``; ``change`` may do more before the file is closed."""
    with RecordingWriter(path, load(), CALIBRATION) as writer:
        writer.append(records)
        if change is not None:
            change(writer)
