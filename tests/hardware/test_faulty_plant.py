"""The robot that breaks on request: nothing without a fault, always the same with one."""

from __future__ import annotations

import time

import numpy as np
import pytest

from hardware.choose import breakable_plant
from hardware.faulty_plant import FAULTS, FaultyPlant, PlantBroke
from hardware.kinematic_plant import KinematicPlant
from hardware.plant import Plant
from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.instrument_robot import InstrumentRobot
from robot.records import Request, Safety
from robot.safety import Event
from robot.sensing.faults import SensingFault
from robot.tension.records import TendonControl, TendonMode
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
    assert FAULTS.keys() == EXPECTED.keys() | OTHERS | SENSING_FAULTS.keys()


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


SENSING_FAULTS = {
    "cell-missing": SensingFault.CELL_MISSING,
    "cell-saturated": SensingFault.CELL_SATURATED,
    "cell-flat": SensingFault.CELL_FLAT,
    "tendon-broken": SensingFault.TENDON_BROKEN,
    "tracker-lost": SensingFault.TRACKER_LOST,
}
RATE_HZ = 500
HELD = {
    "cell-missing": (Safety.PAUSED, Event.TENSION_UNKNOWN, 0.01),
    "cell-saturated": (Safety.PAUSED, Event.TENSION_UNKNOWN, 0.01),
    "cell-flat": (Safety.PAUSED, Event.TENSION_UNKNOWN, 0.07),
    "tendon-broken": (Safety.FAULT, Event.TENDON_RUNS, 2.0),
}
"""Where tensions are held: what that leads to, and within which time, s."""


def enabled(loop: InstrumentLoop) -> bool:
    return loop.safety == Safety.ENABLED


def unit_driven(control: str) -> tuple[InstrumentLoop, FaultyPlant]:
    """A robot with the tension-feedback unit, at rest, whose drives hold what ``control`` says."""
    base = load()
    driven = {"actuation": "tension-unit", "board": "none"}
    configuration = base.model_copy(
        update={
            "simulation": base.simulation.model_copy(update=driven),
            "tendons": base.tendons.model_copy(update={"control": control}),
        }
    )
    robot = InstrumentRobot(configuration)
    plant = breakable_plant(configuration, robot.initial_state()["x"][0])
    assert isinstance(plant, FaultyPlant)
    return InstrumentLoop(robot, plant, configuration), plant


def steps(loop: InstrumentLoop, seconds: float) -> np.ndarray:
    """Let time pass; the true tip then, (3,) mm."""
    for _ in range(round(seconds * RATE_HZ)):
        loop.step()
    return np.asarray(loop.record["truth"]["position"][0] * 1e3)


def test_what_sensing_needs_can_be_broken() -> None:
    """The estimate says what is wrong, and is valid again once it is mended."""
    loop, plant = unit_driven("position")

    def found(seconds: float) -> SensingFault:
        steps(loop, seconds)
        return SensingFault(int(loop.record["outcome"]["report"]["estimate_fault"][0]))

    assert found(0.3) is SensingFault.NONE
    for name, fault in SENSING_FAULTS.items():
        plant.inject(name)
        assert found(0.07) is fault, name
        plant.clear()
        assert found(0.3) is SensingFault.NONE, name
    plant.close()


def test_a_torn_tendon_lets_the_bent_segment_go_until_it_is_tied_again() -> None:
    loop, plant = unit_driven("position")
    loop.request = Request.ENABLE
    before = steps(loop, 0.3)
    plant.inject("tendon-broken")
    torn = steps(loop, 1.0)
    assert loop.record["truth"]["tension"][0, 0] == 0.0
    assert np.linalg.norm(torn - before) > 5.0
    plant.clear()
    tied = steps(loop, 1.0)
    assert np.linalg.norm(tied - before) < 0.5
    assert loop.record["truth"]["tension"][0, 0] > 1.0
    plant.close()


@pytest.mark.parametrize("name", HELD)
def test_what_breaks_while_tensions_are_held_stops_the_robot(name: str) -> None:
    loop, plant = unit_driven("hybrid")
    loop.request = Request.ENABLE
    steps(loop, 0.3)
    assert enabled(loop)
    plant.inject(name)
    ticks = 0
    while enabled(loop) and ticks < HELD[name][2] * RATE_HZ:
        loop.step()
        ticks += 1
    state = loop.record["outcome"]["state"][0]
    assert (Safety(state["safety"]), Event(state["reason"])) == HELD[name][:2]
    stood = loop.record["outcome"]["command"]["servo"].copy()
    steps(loop, 0.5)
    np.testing.assert_array_equal(loop.record["outcome"]["command"]["servo"], stood)
    assert (loop.record["outcome"]["command"]["tendon_mode"] == TendonMode.POSITION).all()
    plant.close()


def test_a_tendon_that_ran_away_is_tied_and_driven_again_with_lengths() -> None:
    loop, plant = unit_driven("tension")
    loop.request = Request.ENABLE
    steps(loop, 0.3)
    plant.inject("tendon-broken")
    steps(loop, 2.0)
    assert loop.safety == Safety.FAULT
    plant.clear()
    # Its pulley has wound up too far for a hand.
    at_fault = steps(loop, 0.5)
    assert loop.record["truth"]["tension"][0, 0] == 0.0
    loop.settings["tendon_control"] = TendonControl.POSITION
    for request, state in ((Request.RESET, Safety.DISABLED), (Request.ENABLE, Safety.ENABLED)):
        loop.request = request
        again = steps(loop, 0.1)
        assert loop.safety == state
    assert np.linalg.norm(again - at_fault) < 0.1
    loop.start_path(far_and_turned())
    steps(loop, 4.5)
    assert enabled(loop)
    assert (loop.record["truth"]["tension"][0] > 0.2).all()
    assert loop.record["outcome"]["report"]["estimate_fault"][0] == SensingFault.NONE
    plant.close()
