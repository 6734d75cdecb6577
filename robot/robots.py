"""The robots by name: which controller a configuration chooses."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from robot.calibration import Calibration
from robot.configuration import Configuration

TITLES = {
    "instrument": "Tendon-driven instrument on a 7-joint arm",
    "concentric": "Two concentric-tube arms through one endoscope",
}
"""What people read for the name of each robot."""


class Robot(Protocol):
    """A pure robot."""

    name: str

    def initial_state(self) -> np.ndarray:
        """The (1,) state in which it wakes up."""

    def tick(self, state: np.ndarray, tick_input: np.ndarray, outcome: np.ndarray) -> None:
        """One step: fill the (1,) outcome from (1,) state and input."""


def make_robot(configuration: Configuration, calibration: Calibration | None = None) -> Robot:
    """The robot that ``configuration`` chooses.

    Args:
        configuration: describes it.
        calibration: of the instrument's tendons.

    Raises:
        KeyholeError: its start cannot be reached.
    """
    if configuration.robot == "concentric":
        from robot.concentric.concentric_robot import ConcentricRobot

        return ConcentricRobot(configuration)
    from robot.instrument_robot import InstrumentRobot

    return InstrumentRobot(configuration, calibration)
