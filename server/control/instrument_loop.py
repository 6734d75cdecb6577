"""The loop of the instrument: trocar, boards, and what arm and servos measure."""

from __future__ import annotations

from typing import Any

import numpy as np

from hardware.plant import Plant
from robot.configuration import Configuration
from robot.forward import ForwardKinematics, measure_errors
from robot.instrument_robot import InstrumentRobot
from robot.priority.levels import case_named
from robot.priority.limits import stands_inside
from robot.records import (
    INSTRUMENT,
    SETTINGS,
    Compensation,
    Coordinates,
    ErrorSource,
    Readiness,
    Request,
    Safety,
    Solver,
)
from robot.tendons import bend_from_servos
from robot.tension.feasibility import CONTROL_NAMES
from robot.urdf import urdf_text
from scenes.boards.board import board
from scenes.trocar_motion import Breathing
from server.control.loop import ControlLoop, set_shared
from server.control.trocar import LoopTrocar, ShaftFinder
from server.memory.link_records import TrocarSource

SOLVER_NAMES = {
    "hqp": Solver.HQP,
    "closed-form": Solver.CLOSED_FORM,
    "augmented": Solver.AUGMENTED,
}
COORDINATE_NAMES = {"uv": Coordinates.UV, "polar": Coordinates.POLAR}

COMPENSATION_NAMES = {
    "off": Compensation.OFF,
    "gain": Compensation.GAIN,
    "full": Compensation.FULL,
}


def default_settings(configuration: Configuration) -> np.ndarray:
    """The (1,) operator settings that the configuration starts with."""
    settings = np.zeros(1, SETTINGS)
    priority = configuration.priority
    set_shared(settings, configuration)
    settings["case"] = case_named(priority.case)
    settings["solver"] = SOLVER_NAMES[priority.solver]
    settings["coordinates"] = COORDINATE_NAMES[priority.coordinates]
    settings["feed_forward"] = configuration.commands.feed_forward
    settings["compensation"] = COMPENSATION_NAMES[configuration.compensation.mode]
    settings["use_tracker"] = configuration.tracker.enabled
    settings["sensing"] = configuration.sensing.enabled
    settings["tendon_control"] = CONTROL_NAMES[configuration.tendons.control]
    settings["co_contraction"] = configuration.tendons.co_contraction_n
    settings["lambda_reference"] = priority.lambda_reference
    return settings


class InstrumentLoop(ControlLoop):
    """The instrument, its plant, and its surroundings.

    Attributes:
        trocar: where it is, and how it breathes.
        board: name of the board before the instrument.
    """

    robot: InstrumentRobot

    def __init__(self, robot: InstrumentRobot, plant: Plant, configuration: Configuration) -> None:
        super().__init__(robot, plant, configuration, INSTRUMENT, default_settings(configuration))
        self.trocar = LoopTrocar(configuration)
        self.board: str = configuration.simulation.board
        self._configuration = configuration
        self._shaft = ShaftFinder(configuration)
        self._forward = ForwardKinematics(urdf_text(configuration), robot.parameters)
        hardware = configuration.hardware
        self._arm_is_locked = hardware.connected and hardware.arm == "locked"
        self._measured_q = self._in["measured_q"]
        self._measured_servo = self._in["measured_servo"]
        self._measured_tension = self._in["measured_tension"]
        self._measured_load = self._in["measured_load"]
        self._in["trocar_position"][:] = self.trocar.position

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

    def breathe(self, breathing: Breathing) -> None:
        """Let the trocar breathe like that from now on."""
        self.trocar.breathe(breathing, self.time_s)

    def surroundings(self) -> dict[str, Any]:
        """Where the trocar is registered, how it breathes, and which board is there."""
        breathing = self.trocar.motion.wanted()
        return {
            "board": self.board,
            "trocar_source": self.trocar.source,
            "trocar_registered": self.trocar.registered,
            "breathing_amplitude": breathing.amplitude_m,
            "breathing_period": breathing.period_s,
        }

    def change_board(self, name: str) -> None:
        """Put the board of that name before the instrument; may take longer than a tick."""
        self.plant.change_board(board(name, self._configuration))
        self.board = name

    def _before(self) -> None:
        if self.request == Request.ENABLE:
            self._check_trocar()
        self.trocar.look(self.time_s, self._dt_ns * 1e-9)

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

    def _read_measured(self) -> None:
        measurement = self.plant.read()
        tick_input = self._in
        self._measured_q[:] = measurement.q
        self._measured_servo[:] = measurement.servo
        self._measured_tension[:] = measurement.tension
        self._measured_load[:] = measurement.load
        tick_input["tension_cells"] = measurement.tension_cells
        tick_input["tracker"] = measurement.tracker
        tick_input["measured_contact"] = measurement.contact_n
        self._take_health(measurement)
        if measurement.readiness == Readiness.READY and self._state["safety"][0] != Safety.ENABLED:
            parameters = self.robot.parameters
            if not stands_inside(measurement.q, measurement.servo, parameters):
                tick_input["readiness"] = Readiness.OUTSIDE_LIMITS
        tick_input["trocar_position"] = self.trocar.position
        tick_input["trocar_velocity"] = self.trocar.velocity

    def _restrict(self) -> None:
        if self._arm_is_locked or (self._path is not None and self._path_locks_arm):
            self._in["settings"]["lock_arm"] = 1

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

    def _after(self) -> None:
        if self._state["safety"][0] != Safety.ENABLED:
            self.trocar.follow()
