"""A robot of an arm and a module: what both tell becomes one, and neither stops the other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hardware.arm.device import ArmReading
from hardware.arm.locked import LockedArm
from hardware.choose import make_plant
from hardware.hybrid_plant import HybridPlant, gravest
from hardware.module.module import InstrumentModule, ModuleReading
from robot.instrument_robot import InstrumentRobot
from robot.records import COMMAND, TRUTH, Readiness
from robot.safety import Event
from server.configuration_file import load
from tests.hardware.module.bench import settings

Q = np.linspace(-0.3, 0.3, 7)
PERIOD_NS = 2_000_000
FAULTS = (Event.SERVO_SILENT, Event.SERVO_FAULT, Event.ARM_FAULT)
LOSSES = (Event.NOTHING, Event.BUS_LOST, Event.ARM_LOST)


class Clock:
    """Goes on when it is told."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        return self.now_ns


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def plant(tmp_path: Path, clock: Clock) -> Iterator[HybridPlant]:
    """An arm that stands, and a module whose bus is nowhere to be found."""
    configuration = settings(tmp_path / "nowhere")
    hybrid = HybridPlant(configuration, LockedArm(Q), InstrumentModule(configuration), clock)
    yield hybrid
    hybrid.close()


@pytest.mark.parametrize(
    ("arm", "module"), list(itertools.product([*FAULTS, *LOSSES], [*FAULTS, *LOSSES]))
)
def test_a_fault_is_told_before_a_loss_and_both_before_nothing(arm: Event, module: Event) -> None:
    told = gravest(ArmReading(event=int(arm)), ModuleReading(True, 0.0, int(module), 0))
    faults = [event for event in (module, arm) if event in FAULTS]
    losses = [event for event in (module, arm) if event != Event.NOTHING]
    assert told == (faults or losses or [Event.NOTHING])[0]


def test_without_its_bus_it_is_not_ready_and_says_so(plant: HybridPlant) -> None:
    now = plant.read()
    np.testing.assert_array_equal(now.q, Q)
    assert now.readiness == Readiness.NOT_CONNECTED
    assert not plant.spec.simulated
    assert not plant.truth(np.zeros(1, TRUTH))


@pytest.mark.parametrize(
    ("passed_ns", "told_ns"),
    [(0, PERIOD_NS // 2), (1_900_000, 1_900_000), (3_900_000, 3_900_000), (10**9, 2 * PERIOD_NS)],
)
def test_the_measured_tick_is_told_within_limits(
    plant: HybridPlant, clock: Clock, passed_ns: int, told_ns: int
) -> None:
    plant.advance()
    clock.now_ns += passed_ns
    assert plant.advance() == told_ns


def test_commands_and_acts_without_a_bus_neither_wait_nor_fail(plant: HybridPlant) -> None:
    command = np.zeros(1, COMMAND)
    command["q"], command["moving"] = Q, 1
    for act in (plant.hold, plant.release, plant.take_hold, plant.home, plant.reboot):
        plant.write(command)
        act()
        plant.advance()
    assert plant.read().readiness != Readiness.READY


def test_the_configuration_chooses_the_arm(tmp_path: Path) -> None:
    configuration = settings(tmp_path / "nowhere")
    x = InstrumentRobot(load()).initial_state()["x"][0]
    for arm in ("simulated", "locked"):
        hardware = configuration.hardware.model_copy(update={"connected": True, "arm": arm})
        plant = make_plant(configuration.model_copy(update={"hardware": hardware}), x)
        try:
            assert arm in plant.spec.name
            np.testing.assert_array_equal(plant.read().q, x[:7])
        finally:
            plant.close()
