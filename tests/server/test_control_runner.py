"""The loop over ticks, in this process: what happens when a tick fails or comes late."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest

from hardware.kinematic_plant import KinematicPlant
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import Request, Safety
from robot.safety import Event
from scenes.boards.board import BOARD_NAMES, Board
from server.configuration_file import load
from server.control.instrument_loop import InstrumentLoop
from server.control.lifeline import Lifeline
from server.control.process import Status, drive
from server.control.runner import ControlRunner
from server.memory.control_link import ControlLink
from server.memory.link import WebLink
from server.memory.link_records import create_mapped_files

RATE_HZ = 200.0


class BreakingPlant(KinematicPlant):
    """A plant that fails, or takes its time, at a chosen tick."""

    def __init__(self, configuration: Configuration, x: np.ndarray) -> None:
        super().__init__(configuration, x)
        self.ticks, self.breaks_at, self.dawdles_at, self.held = 0, -1, -1, 0

    def advance(self) -> int:
        self.ticks += 1
        if self.ticks == self.breaks_at:
            raise OSError("the wire\nbroke")
        if self.ticks == self.dawdles_at:
            time.sleep(5.5 / RATE_HZ)
        return super().advance()

    def hold(self) -> None:
        self.held += 1
        super().hold()


@pytest.fixture(scope="module")
def robot() -> InstrumentRobot:
    return InstrumentRobot(load())


@pytest.fixture
def plant(robot: InstrumentRobot) -> BreakingPlant:
    return BreakingPlant(robot.configuration, robot.initial_state()["x"][0])


@pytest.fixture
def web(tmp_path: Path) -> WebLink:
    create_mapped_files(tmp_path, RATE_HZ, 5.0)
    return WebLink(tmp_path)


def make_runner(robot: InstrumentRobot, plant: BreakingPlant, folder: Path) -> ControlRunner:
    loop = InstrumentLoop(robot, plant, robot.configuration)
    return ControlRunner(loop, ControlLink(folder), Lifeline(None), RATE_HZ)


def test_a_failing_tick_holds_marks_a_fault_and_ends(
    robot: InstrumentRobot,
    plant: BreakingPlant,
    web: WebLink,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    plant.breaks_at = 5
    runner = make_runner(robot, plant, tmp_path)
    assert drive(runner, Status(ControlLink(tmp_path), RATE_HZ)) == 1
    assert plant.held == 1
    outcome = web.snapshot()["outcome"][0]
    assert outcome["state"]["safety"] == Safety.FAULT
    assert outcome["state"]["reason"] == Event.CONTROL_FAILED
    assert outcome["command"]["moving"] == 0
    line = capsys.readouterr().err
    assert line.startswith("keyhole control: the control loop failed and the robot holds: OSError")
    assert line.count("\n") == 1
    assert "test_control_runner.py" in line


def test_missed_deadlines_are_counted_and_the_grid_stays(
    robot: InstrumentRobot, plant: BreakingPlant, web: WebLink, tmp_path: Path
) -> None:
    plant.dawdles_at = 10
    runner = make_runner(robot, plant, tmp_path)
    threading.Timer(0.5, runner.stop).start()
    runner.run()
    header = web.ring().read_since(0)[0]["header"]
    after = header[header["tick"] == 11]
    assert after["overruns"][0] - header["overruns"][9] >= 4
    assert after["lateness_ns"][0] > 4e9 / RATE_HZ
    assert (np.diff(header["time_ns"]) == 1e9 / robot.configuration.control.rate_hz).all()
    assert plant.held == 1


class BoardedPlant(BreakingPlant):
    """A plant that takes its time to change boards."""

    boards: list[str]

    def change_board(self, board: Board) -> None:
        time.sleep(50.5 / RATE_HZ)
        self.boards.append(board.name)


def test_boards_are_changed_only_while_disabled_and_cost_no_overruns(
    robot: InstrumentRobot, web: WebLink, tmp_path: Path
) -> None:
    plant = BoardedPlant(robot.configuration, robot.initial_state()["x"][0])
    plant.boards = []
    runner = make_runner(robot, plant, tmp_path)
    web.change_board(BOARD_NAMES.index("ring-board"))
    web.request(Request.ENABLE)
    web.change_board(BOARD_NAMES.index("none"))
    threading.Timer(0.8, runner.stop).start()
    runner.run()
    assert plant.boards == ["ring-board"]
    records = web.ring().read_since(0)[0]
    changed = int(np.argmax(records["header"]["request_sequence"] >= 1))
    counted = records["header"]["overruns"]
    assert counted[changed + 1] - counted[changed] < 25
