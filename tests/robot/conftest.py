"""The robot that the tests of ``robot/`` share: it is pure, so they cannot disturb each other."""

from __future__ import annotations

import numpy as np
import pytest

from robot.arm import Arm
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.urdf import urdf_text
from server.configuration_file import load
from tests.robot.drive import Drive


@pytest.fixture(scope="session")
def configuration() -> Configuration:
    return load()


@pytest.fixture(scope="session")
def robot(configuration: Configuration) -> InstrumentRobot:
    return InstrumentRobot(configuration)


@pytest.fixture(scope="session")
def free_robot(configuration: Configuration) -> InstrumentRobot:
    """A robot that may go anywhere: for random postures, and for targets out of reach."""
    free = {
        "clearance_mm": -1000.0,
        "trocar_distance_mm": 1e6,
        "workspace_min_m": (-9.0, -9.0, -9.0),
        "workspace_max_m": (9.0, 9.0, 9.0),
    }
    limits = configuration.limits.model_copy(update=free)
    return InstrumentRobot(configuration.model_copy(update={"limits": limits}))


@pytest.fixture(scope="session")
def parameters(robot: InstrumentRobot) -> np.ndarray:
    return robot.parameters


@pytest.fixture
def arm(configuration: Configuration) -> Arm:
    return Arm(urdf_text(configuration))


@pytest.fixture
def drive(robot: InstrumentRobot) -> Drive:
    """A disabled robot at its start."""
    return Drive(robot)
