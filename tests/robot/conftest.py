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
def parameters(robot: InstrumentRobot) -> np.ndarray:
    return robot.parameters


@pytest.fixture
def arm(configuration: Configuration) -> Arm:
    return Arm(urdf_text(configuration))


@pytest.fixture
def drive(robot: InstrumentRobot) -> Drive:
    """A disabled robot at its start."""
    return Drive(robot)
