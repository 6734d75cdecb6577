"""Which robot stands behind the controller."""

from __future__ import annotations

import numpy as np

from hardware.kinematic_plant import KinematicPlant
from hardware.physics.plant import PhysicsPlant
from hardware.plant import Plant
from robot.configuration import Configuration
from scenes.boards.board import board


def make_plant(configuration: Configuration, x: np.ndarray) -> Plant:
    """The plant that ``configuration.simulation`` names, standing at ``x``.

    Args:
        configuration: describes robot and simulation.
        x: (10,) the controller's configuration at the start.
    """
    simulation = configuration.simulation
    if simulation.plant == "kinematic":
        return KinematicPlant(configuration, x)
    return PhysicsPlant(configuration, x, board(simulation.board, configuration))
