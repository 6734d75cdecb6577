"""One tick of the whole: read, decide, write, advance, and the record of it all.

The same object runs in the control process and headless; what differs is who calls ``step``. What
only one robot has stands in a class of its own, beside this one.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from hardware.faulty_plant import FaultyPlant
from hardware.plant import Measurement, Plant
from robot.configuration import Configuration
from robot.records import (
    LEADER,
    SCHEMA_VERSION,
    Alignment,
    LeaderKind,
    RecordTypes,
    Request,
    Safety,
)
from robot.robots import Robot
from robot.rotations import matrix_from_quaternion, multiply, quaternion_from_matrix
from scenes.path import Path
from scenes.trocar_motion import Breathing
from server.memory.link_records import TrocarSource

ALIGNMENT_NAMES = {"relative": Alignment.RELATIVE, "matched": Alignment.MATCHED}


def set_shared(settings: np.ndarray, configuration: Configuration) -> None:
    """Set the choices that every robot has to what the configuration starts with."""
    teleoperation = configuration.teleoperation
    settings["alignment"] = ALIGNMENT_NAMES[teleoperation.alignment]
    settings["hold_to_move"] = teleoperation.hold_to_move
    settings["motion_scale"] = teleoperation.motion_scale
    settings["rotation_base_leader"] = np.eye(3)


class ControlLoop(ABC):
    """A robot, its plant, and what reaches them from outside.

    Attributes:
        record: (1,) record of the last step; its memory is reused by every step.
        settings: (1,) settings in force from the next step on.
        leader: (1,) ``LEADER``: the active leader's newest sample.
        request: a ``Request`` for the next step; consumed by it.
        hold: 1 while the hold-to-move key is down.
        late_s: how long after its deadline the next step begins.
    """

    def __init__(
        self,
        robot: Robot,
        plant: Plant,
        configuration: Configuration,
        types: RecordTypes,
        settings: np.ndarray,
    ) -> None:
        self.robot, self.plant = robot, plant
        self.record = np.zeros(1, types.record)
        self.settings = settings
        self.leader = np.zeros(1, LEADER)
        self.request: int = Request.NONE
        self.hold = 0
        self.late_s = 0.0
        self._state = robot.initial_state()
        self._path: Path | None = None
        self._path_time_ns, self._path_locks_arm = 0, False
        self._path_start_position = np.zeros(3)
        self._path_start_rotation = np.zeros((3, 3))
        self._path_sample = np.zeros(7)
        self._dt_ns = plant.spec.tick_ns
        self._views()
        header = self._header
        header["schema_version"] = SCHEMA_VERSION
        header["robot"] = robot.name.encode()
        header["configuration_hash"] = configuration.hash64()

    def _views(self) -> None:
        """Views into the record, made once: making one costs as much as the kinematics."""
        record = self.record
        self._header = record["header"][0]
        self._input = record["input"]
        self._outcome = record["outcome"]
        self._command = self._outcome["command"]
        self._truth = record["truth"]
        self._in = self._input[0]
        self._in_leader = self._in["leader"]
        self._next_state = self._outcome["state"]
        self._desired_position = self._outcome["report"]["desired_position"][0]
        self._desired_wxyz = self._outcome["report"]["desired_wxyz"][0]
        self._leader_position = self._in["leader"]["position"]
        self._leader_wxyz = self._in["leader"]["wxyz"]

    @property
    def time_s(self) -> float:
        """The plant's clock, s."""
        return float(self._header["time_ns"]) * 1e-9

    @property
    def safety(self) -> Safety:
        """The safety state."""
        return Safety(int(self._state["safety"][0]))

    @property
    def path(self) -> Path | None:
        """The path that is playing."""
        return self._path

    def inject(self, fault: str) -> None:
        """Put a fault into a simulated plant, or clear all of them with ""; see
        ``hardware.faulty_plant``. A real robot is left alone.
        """
        if not isinstance(self.plant, FaultyPlant):
            return
        if fault in self.plant.faults:
            self.plant.inject(fault)
        else:
            self.plant.clear()

    # What each robot has of its own

    @abstractmethod
    def register_trocar(self, source: TrocarSource, position: np.ndarray) -> None:
        """Take the trocar to be at ``position`` (3,), base frame, m; not while ENABLED."""

    @abstractmethod
    def breathe(self, breathing: Breathing) -> None:
        """Let the trocar breathe like that from now on."""

    @abstractmethod
    def change_board(self, name: str) -> None:
        """Put the board of that name before the robot; may take longer than a tick."""

    @abstractmethod
    def surroundings(self) -> dict[str, Any]:
        """Fields of ``link_records.STATUS`` that tell of trocar and board."""

    @abstractmethod
    def _before(self) -> None:
        """What comes before the plant is read."""

    @abstractmethod
    def _read_measured(self) -> None:
        """Copy what the plant measures into the tick's input."""

    @abstractmethod
    def _restrict(self) -> None:
        """Change the settings of this tick only."""

    @abstractmethod
    def _measure(self) -> None:
        """Fill the truth and the errors against it."""

    @abstractmethod
    def _after(self) -> None:
        """What comes after the state has been taken over."""

    # Paths

    def start_path(self, path: Path, path_id: int = 0, lock_arm: bool = False) -> None:
        """Play ``path`` from where the commanded tip is now; it excludes every other leader.

        With ``lock_arm`` the arm stands still as long as it plays.
        """
        self._path, self._path_time_ns, self._path_locks_arm = path, 0, lock_arm
        self._path_start_position[:] = self._state["desired_position"][0]
        self._path_start_rotation[:] = self._state["desired_rotation"][0]
        self._header["path_id"] = path_id
        self._header["path_progress"] = 0.0

    def stop_path(self) -> None:
        """Stop playing; the tip stays where it is."""
        self._path = None
        self._header["path_id"] = 0
        self._header["path_progress"] = 0.0

    def _path_leader(self, path: Path) -> None:
        """Write the path's target at the end of the coming tick as the leader's sample."""
        time_s = self._path_time_ns * 1e-9
        sample, leader = self._path_sample, self._in_leader
        path.at(time_s, sample)
        leader["kind"] = LeaderKind.PATH
        leader["clutch"] = 1
        leader["absolute"] = 1
        leader["age_s"] = 0.0
        leader["timeout_s"] = 1.0
        leader["smoothing_s"] = 0.0
        leader["sequence"] += 1
        np.add(self._path_start_position, sample[:3], out=self._leader_position)
        turn, turned = np.empty((3, 3)), np.empty((3, 3))
        matrix_from_quaternion(sample[3:], turn)
        multiply(turn, self._path_start_rotation, turned)
        quaternion_from_matrix(turned, self._leader_wxyz)
        self._header["path_progress"] = min(1.0, time_s / path.duration_s)

    def _advance_path(self) -> None:
        path, state = self._path, self._state
        if path is None:
            return
        ended = self._path_time_ns >= round(path.duration_s * 1e9)
        if ended or state["safety"][0] != Safety.ENABLED:
            self.stop_path()
        elif state["engaged"][0]:
            self._path_time_ns += self._dt_ns

    # The tick

    def _take_health(self, measurement: Measurement) -> None:
        """What a measurement says of the devices and of itself."""
        tick_input = self._in
        tick_input["plant_event"] = measurement.event
        tick_input["readiness"] = measurement.readiness
        tick_input["measured_valid"] = measurement.valid
        tick_input["measured_age_s"] = measurement.age_s

    def _read(self) -> None:
        self._read_measured()
        tick_input = self._in
        tick_input["late_s"] = self.late_s
        tick_input["dt_s"] = self._dt_ns * 1e-9
        tick_input["request"] = self.request
        tick_input["hold"] = self.hold
        tick_input["settings"] = self.settings[0]
        if self._path is not None:
            self._path_leader(self._path)
        else:
            tick_input["leader"] = self.leader[0]
        self._restrict()
        self.request = Request.NONE

    def step(self) -> None:
        """Read, tick, write, advance, measure; ``record`` then tells everything about it."""
        started = time.perf_counter_ns()
        self._before()
        self._read()
        self.robot.tick(self._state, self._input, self._outcome)
        header = self._header
        header["tick_ns"] = time.perf_counter_ns() - started
        self.plant.write(self._command)
        self._dt_ns = self.plant.advance()
        self._measure()
        self._state[:] = self._next_state
        header["tick"] = self._state["tick"][0]
        header["dt_ns"] = self._dt_ns
        header["time_ns"] += self._dt_ns
        self._after()
        self._advance_path()
