"""One tick of the whole: read, decide, write, advance, and the record of it all.

The same object runs in the control process and headless; what differs is who calls ``step``.
"""

from __future__ import annotations

import time

import numpy as np

from hardware.faulty_plant import FAULTS, FaultyPlant
from hardware.plant import Plant
from robot.configuration import Configuration
from robot.forward import ForwardKinematics, measure_errors
from robot.instrument_robot import InstrumentRobot
from robot.priority.levels import case_named
from robot.priority.limits import stands_inside
from robot.records import (
    LEADER,
    RECORD,
    SCHEMA_VERSION,
    SETTINGS,
    Alignment,
    Compensation,
    Coordinates,
    ErrorSource,
    LeaderKind,
    Readiness,
    Request,
    Safety,
    Solver,
)
from robot.rotations import matrix_from_quaternion, multiply, quaternion_from_matrix
from robot.tendons import bend_from_servos
from robot.urdf import urdf_text
from scenes.path import Path
from server.control.trocar import LoopTrocar, ShaftFinder
from server.memory.link_records import TrocarSource

SOLVER_NAMES = {
    "hqp": Solver.HQP,
    "closed-form": Solver.CLOSED_FORM,
    "augmented": Solver.AUGMENTED,
}
COORDINATE_NAMES = {"uv": Coordinates.UV, "polar": Coordinates.POLAR}
ALIGNMENT_NAMES = {"relative": Alignment.RELATIVE, "matched": Alignment.MATCHED}

COMPENSATION_NAMES = {
    "off": Compensation.OFF,
    "gain": Compensation.GAIN,
    "full": Compensation.FULL,
}


def default_settings(configuration: Configuration) -> np.ndarray:
    """The (1,) operator settings that the configuration starts with."""
    settings = np.zeros(1, SETTINGS)
    priority, teleoperation = configuration.priority, configuration.teleoperation
    settings["case"] = case_named(priority.case)
    settings["solver"] = SOLVER_NAMES[priority.solver]
    settings["coordinates"] = COORDINATE_NAMES[priority.coordinates]
    settings["feed_forward"] = configuration.commands.feed_forward
    settings["alignment"] = ALIGNMENT_NAMES[teleoperation.alignment]
    settings["hold_to_move"] = teleoperation.hold_to_move
    settings["motion_scale"] = teleoperation.motion_scale
    settings["compensation"] = COMPENSATION_NAMES[configuration.compensation.mode]
    settings["use_tracker"] = configuration.tracker.enabled
    settings["lambda_reference"] = priority.lambda_reference
    settings["rotation_base_leader"] = np.eye(3)
    return settings


class ControlLoop:
    """The robot, its plant, and what reaches them from outside.

    Attributes:
        record: (1,) ``RECORD`` of the last step; its memory is reused by every step.
        settings: (1,) ``SETTINGS`` in force from the next step on.
        leader: (1,) ``LEADER``: the active leader's newest sample.
        request: a ``Request`` for the next step; consumed by it.
        hold: 1 while the hold-to-move key is down.
        late_s: how long after its deadline the next step begins.
        trocar: where it is, and how it breathes.
    """

    def __init__(self, robot: InstrumentRobot, plant: Plant, configuration: Configuration) -> None:
        self.robot, self.plant = robot, plant
        self.record = np.zeros(1, RECORD)
        self.settings = default_settings(configuration)
        self.leader = np.zeros(1, LEADER)
        self.request: int = Request.NONE
        self.hold = 0
        self.late_s = 0.0
        self.trocar = LoopTrocar(configuration)
        self._shaft = ShaftFinder(configuration)
        self._state = robot.initial_state()
        self._forward = ForwardKinematics(urdf_text(configuration), robot.parameters)
        self._path: Path | None = None
        self._path_time_ns, self._path_locks_arm = 0, False
        self._path_start_position = np.zeros(3)
        self._path_start_rotation = np.zeros((3, 3))
        self._path_sample = np.zeros(7)
        self._dt_ns = plant.spec.tick_ns
        hardware = configuration.hardware
        self._arm_is_locked = hardware.connected and hardware.arm == "locked"
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
        self._measured_q = self._in["measured_q"]
        self._measured_servo = self._in["measured_servo"]
        self._measured_tension = self._in["measured_tension"]
        self._measured_load = self._in["measured_load"]
        self._next_state = self._outcome["state"]
        self._desired_position = self._outcome["report"]["desired_position"][0]
        self._desired_wxyz = self._outcome["report"]["desired_wxyz"][0]
        self._leader_position = self._in["leader"]["position"]
        self._leader_wxyz = self._in["leader"]["wxyz"]
        self._in["trocar_position"][:] = self.trocar.position

    @property
    def time_s(self) -> float:
        """The plant's clock, s."""
        return float(self._header["time_ns"]) * 1e-9

    @property
    def safety(self) -> Safety:
        """The safety state."""
        return Safety(int(self._state["safety"][0]))

    @property
    def trocar_position(self) -> np.ndarray:
        """(3,) where the controller was told that the trocar is, base frame, m."""
        return self.trocar.position

    @property
    def trocar_velocity(self) -> np.ndarray:
        """(3,) how it was told that the trocar moves, m/s."""
        return self.trocar.velocity

    def register_trocar(self, source: TrocarSource, position: np.ndarray) -> None:
        """Take the trocar to be at ``position`` (3,), base frame, m; not while ENABLED."""
        state = self._state[0]
        self.trocar.register(source, position, self.time_s)
        self._shaft.find(state["safety"], state["x"], self.plant.read().q)
        touched = source == TrocarSource.TOUCH
        self.plant.register_trocar(position if touched else self._shaft.stand(position).nearest)

    def _check_trocar(self) -> None:
        """Before enabling: refuse it with the shaft outside of the trocar, else lead it there."""
        state, trocar = self._state[0], self.trocar
        if state["safety"] == Safety.ENABLED:
            return
        self._shaft.find(state["safety"], state["x"], self.plant.read().q)
        stand = self._shaft.stand(trocar.at(self.time_s))
        if self._shaft.is_inserted(stand):
            trocar.lead(stand, self.time_s)
        else:
            self.request = Request.NONE

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
        if fault in FAULTS:
            self.plant.inject(fault)
        else:
            self.plant.clear()

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

    def _read(self) -> None:
        measurement = self.plant.read()
        tick_input = self._in
        self._measured_q[:] = measurement.q
        self._measured_servo[:] = measurement.servo
        self._measured_tension[:] = measurement.tension
        self._measured_load[:] = measurement.load
        tick_input["tracker"] = measurement.tracker
        tick_input["measured_contact"] = measurement.contact_n
        tick_input["plant_event"] = measurement.event
        tick_input["readiness"] = measurement.readiness
        if measurement.readiness == Readiness.READY and self._state["safety"][0] != Safety.ENABLED:
            parameters = self.robot.parameters
            if not stands_inside(measurement.q, measurement.servo, parameters):
                tick_input["readiness"] = Readiness.OUTSIDE_LIMITS
        tick_input["late_s"] = self.late_s
        tick_input["measured_valid"] = measurement.valid
        tick_input["measured_age_s"] = measurement.age_s
        tick_input["dt_s"] = self._dt_ns * 1e-9
        tick_input["request"] = self.request
        tick_input["hold"] = self.hold
        tick_input["trocar_position"] = self.trocar.position
        tick_input["trocar_velocity"] = self.trocar.velocity
        tick_input["settings"] = self.settings[0]
        if self._path is not None:
            self._path_leader(self._path)
            if self._path_locks_arm:
                tick_input["settings"]["lock_arm"] = 1
        else:
            tick_input["leader"] = self.leader[0]
        if self._arm_is_locked:
            tick_input["settings"]["lock_arm"] = 1
        self.request = Request.NONE

    def _measure(self) -> None:
        truth = self._truth
        truth["trocar_position"] = self.trocar.actual
        source = ErrorSource.TRUE
        if not self.plant.truth(truth):
            source = ErrorSource.MEASURED
            measurement = self.plant.read()
            p = self.robot.parameters[0]
            u, v = bend_from_servos(measurement.servo, p["pitch_radius"], p["pulley_radius"])
            self._forward.fill(truth, measurement.q, u, v)
        truth["source"] = source
        measure_errors(truth, self._desired_position, self._desired_wxyz)

    def step(self) -> None:
        """Read, tick, write, advance, measure; ``record`` then tells everything about it."""
        started = time.perf_counter_ns()
        if self.request == Request.ENABLE:
            self._check_trocar()
        self.trocar.look(self.time_s, self._dt_ns * 1e-9)
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
        if self._state["safety"][0] != Safety.ENABLED:
            self.trocar.follow()
        self._advance_path()
