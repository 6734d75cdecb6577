"""The loop of the concentric-tube arms: what their tubes measure, and where they truly are."""

from __future__ import annotations

from typing import Any

import numpy as np

from hardware.plant import Plant
from robot.concentric.concentric_robot import ConcentricRobot
from robot.concentric.design import METHODS
from robot.configuration import Configuration
from robot.records import Alignment
from scenes.trocar_motion import Breathing
from server.control.loop import ControlLoop, set_shared
from server.memory.link_records import TrocarSource


def default_settings(robot: ConcentricRobot) -> np.ndarray:
    """The (1,) operator settings that the robot's configuration starts with."""
    settings = np.zeros(1, robot.types.settings)
    set_shared(settings, robot.configuration)
    settings["method"] = METHODS.index(robot.configuration.concentric.method)
    return settings


class ConcentricLoop(ControlLoop):
    """Two concentric-tube arms and their plant."""

    robot: ConcentricRobot

    def __init__(self, robot: ConcentricRobot, plant: Plant, configuration: Configuration) -> None:
        super().__init__(robot, plant, configuration, robot.types, default_settings(robot))

    def register_trocar(self, source: TrocarSource, position: np.ndarray) -> None:
        """There is no trocar: the endoscope's face is where the base frame is."""

    def breathe(self, breathing: Breathing) -> None:
        """Nothing breathes."""

    def change_board(self, name: str) -> None:
        """These arms know no boards."""

    def surroundings(self) -> dict[str, Any]:
        """No trocar, no board."""
        return {"board": "none"}

    def _before(self) -> None:
        """Nothing comes before the plant is read."""

    def _read_measured(self) -> None:
        measurement = self.plant.read()
        self._in["measured_q"] = measurement.q
        self._take_health(measurement)

    def _restrict(self) -> None:
        # Positions only are led: the tips turn as they must.
        settings = self._in["settings"]
        settings["lock_rotation"], settings["alignment"] = 1, Alignment.RELATIVE

    def _measure(self) -> None:
        self.plant.truth(self._truth)
        truth, state = self._truth[0], self._next_state[0]
        truth["position_error"] = np.linalg.norm(self._desired_position - truth["position"])
        relative = truth["position_b"] - truth["position"]
        truth["relative_error"] = np.linalg.norm(state["relative_position"] - relative)

    def _after(self) -> None:
        """Nothing follows the tick."""
