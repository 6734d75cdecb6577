"""The robot that breaks on request: nothing without a fault, always the same with one."""

from __future__ import annotations

import time

import numpy as np
import pytest

from hardware.faulty_plant import FAULTS, FaultyPlant, PlantBroke
from hardware.kinematic_plant import KinematicPlant
from hardware.plant import Plant
from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.instrument_robot import InstrumentRobot
from robot.records import Request, Safety
from robot.safety import Event
from scenes.path import Path
from server.configuration_file import load
from server.control.instrument_loop import InstrumentLoop

EXPECTED = {
    "measurement-lost": (Safety.FAULT, Event.MEASUREMENT_LOST),
    "measurement-silent": (Safety.FAULT, Event.MEASUREMENT_LOST),
    "measurement-nan": (Safety.FAULT, Event.MEASUREMENT_LOST),
    "joint-stuck": (Safety.FAULT, Event.TROCAR_LEFT),
    "servo-stuck": (Safety.FAULT, Event.TRACKING_ERROR),
    "encoder-jump": (Safety.FAULT, Event.TRACKING_ERROR),
    "arm-pushed": (Safety.FAULT, Event.TROCAR_LEFT),
    "outside-limits": (Safety.FAULT, Event.TRACKING_ERROR),
    "contact": (Safety.PAUSED, Event.CONTACT_FORCE),
    "simulation-broken": (Safety.FAULT, Event.SIMULATION_FAILED),
    "bus-lost": (Safety.PAUSED, Event.BUS_LOST),
    "servo-silent": (Safety.FAULT, Event.SERVO_SILENT),
    "servo-overload": (Safety.FAULT, Event.SERVO_FAULT),
    "arm-lost": (Safety.PAUSED, Event.ARM_LOST),
    "arm-error": (Safety.FAULT, Event.ARM_FAULT),
}
"""What the loop does about it. Late ticks are the runner's, exceptions end the process."""

OTHERS = {"late-tick", "plant-exception", "picture-impossible"}


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return load()


@pytest.fixture(scope="module")
def robot(configuration: Configuration) -> InstrumentRobot:
    return InstrumentRobot(configuration)


def far_and_turned() -> Path:
    """Moves and turns the tip so much that a stuck axis shows."""
    samples = np.zeros((3, 8))
    samples[:, 0] = (0.0, 2.0, 4.0)
    samples[1, 1:4] = (-0.02, 0.06, 0.0)
    samples[:, 4] = 1.0
    samples[1, 4:8] = (np.cos(0.7), -np.sin(0.7), 0.0, 0.0)
    return Path(samples, "far")


def driven(
    robot: InstrumentRobot, configuration: Configuration
) -> tuple[InstrumentLoop, FaultyPlant]:
    plant = FaultyPlant(KinematicPlant(configuration, robot.initial_state()["x"][0]))
    loop = InstrumentLoop(robot, plant, configuration)
    loop.request = Request.ENABLE
    loop.step()
    loop.start_path(far_and_turned())
    for _ in range(100):
        loop.step()
    assert loop.safety == Safety.ENABLED
    return loop, plant


def test_every_fault_has_an_expectation() -> None:
    assert FAULTS.keys() == EXPECTED.keys() | OTHERS


def test_it_passes_everything_on_while_nothing_is_injected(configuration: Configuration) -> None:
    start = np.array([0.1, 0.4, -0.2, 1.2, 0.1, 1.5, -0.3, 0.6, -0.4, 0.4])
    inner = KinematicPlant(configuration, start)
    plant: Plant = FaultyPlant(inner)
    assert plant.read() is inner.read()
    assert plant.spec is inner.spec
    assert plant.advance() == inner.spec.tick_ns


@pytest.mark.parametrize("name", EXPECTED)
def test_every_fault_is_noticed_and_nothing_moves_afterwards(
    name: str, robot: InstrumentRobot, configuration: Configuration
) -> None:
    loop, plant = driven(robot, configuration)
    plant.inject(name)
    for _ in range(2000):
        loop.step()
        if loop.safety != Safety.ENABLED:
            break
    state = loop.record["outcome"]["state"][0]
    assert (Safety(state["safety"]), Event(state["reason"])) == EXPECTED[name]
    stood = state["x"].copy()
    plant.clear()
    for _ in range(50):
        loop.step()
        assert loop.safety == EXPECTED[name][0]
        assert not loop.record["outcome"]["command"]["moving"][0]
    np.testing.assert_array_equal(loop.record["outcome"]["state"]["x"][0], stood)


def test_the_same_fault_at_the_same_time_is_the_same_to_the_bit(
    robot: InstrumentRobot, configuration: Configuration
) -> None:
    outcomes = []
    for _ in range(2):
        loop, plant = driven(robot, configuration)
        plant.inject("joint-stuck")
        for _ in range(300):
            loop.step()
        outcomes.append(loop.record["outcome"].tobytes())
    assert outcomes[0] == outcomes[1]


def test_the_plant_may_raise(robot: InstrumentRobot, configuration: Configuration) -> None:
    loop, plant = driven(robot, configuration)
    plant.inject("plant-exception")
    with pytest.raises(PlantBroke):
        loop.step()
    plant.clear()
    loop.step()


def test_a_late_tick_is_late_once(robot: InstrumentRobot, configuration: Configuration) -> None:
    loop, plant = driven(robot, configuration)
    plant.inject("late-tick")
    started = time.monotonic()
    loop.step()
    assert time.monotonic() - started > FAULTS["late-tick"].late_s
    assert plant._late_s == 0.0


def test_an_impossible_picture_changes_no_command(
    robot: InstrumentRobot, configuration: Configuration
) -> None:
    loop, plant = driven(robot, configuration)
    plant.inject("picture-impossible")
    for _ in range(20):
        loop.step()
    assert np.isnan(loop.record["truth"]["position"]).all()
    assert loop.safety == Safety.ENABLED
    assert loop.record["outcome"]["command"]["moving"][0]


def test_an_unknown_fault_is_refused_by_name(configuration: Configuration) -> None:
    plant = FaultyPlant(KinematicPlant(configuration, np.zeros(10)))
    with pytest.raises(UnknownName, match="joint-stuck"):
        plant.inject("rust")
    assert plant.active == ""
