"""The exact kinematic plant: stands where it was told, and knows its own truth."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.kinematic_plant import KinematicPlant
from robot.configuration import Configuration
from robot.records import COMMAND, TRUTH
from server.configuration_file import load
from tests import own_kinematics

START = np.array([0.1, 0.4, -0.2, 1.2, 0.1, 1.5, -0.3, 0.6, -0.4, 0.4])


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return load()


@pytest.fixture
def plant(configuration: Configuration) -> KinematicPlant:
    return KinematicPlant(configuration, START)


def command(rng: np.random.Generator) -> np.ndarray:
    """Any joints, and servos whose opposite pairs agree."""
    one = np.zeros(1, COMMAND)
    one["q"] = rng.uniform(-1, 1, 7)
    pulled, turned = rng.uniform(-0.4, 0.4, 2)
    one["servo"] = [-pulled, turned, pulled, -turned]
    return one


def where(plant: KinematicPlant) -> tuple[np.ndarray, np.ndarray]:
    measured = plant.read()
    assert measured.valid
    assert measured.age_s == 0.0
    return measured.q.copy(), measured.servo.copy()


def test_it_begins_where_it_was_put(plant: KinematicPlant) -> None:
    q, servo = where(plant)
    np.testing.assert_array_equal(q, START[:7])
    u, v = START[7:9]
    np.testing.assert_allclose(servo, np.array([-u, v, u, -v]) / 3.0, rtol=0, atol=1e-15)


def test_it_says_what_it_is(configuration: Configuration, plant: KinematicPlant) -> None:
    spec = plant.spec
    assert (spec.name, spec.simulated) == ("kinematic", True)
    assert spec.tick_ns == round(1e9 / configuration.control.rate_hz)
    names = [actuator.name for actuator in spec.actuators]
    assert names == [joint.name for joint in configuration.arm.joints] + [
        "servo1",
        "servo2",
        "servo3",
        "servo4",
    ]
    assert {actuator.unit for actuator in spec.actuators} == {"rad"}


def test_it_stands_at_the_command_after_a_tick_and_not_before(
    plant: KinematicPlant, rng: np.random.Generator
) -> None:
    for _ in range(20):
        before, asked = where(plant), command(rng)
        plant.write(asked)
        for old, now in zip(before, where(plant), strict=True):
            np.testing.assert_array_equal(old, now)
        assert plant.advance() == plant.spec.tick_ns
        q, servo = where(plant)
        np.testing.assert_array_equal(q, asked["q"][0])
        np.testing.assert_array_equal(servo, asked["servo"][0])


def test_it_stays_where_it_is_without_commands(plant: KinematicPlant) -> None:
    before = where(plant)
    for _ in range(10):
        plant.advance()
    for old, now in zip(before, where(plant), strict=True):
        np.testing.assert_array_equal(old, now)


@pytest.mark.parametrize("act", ["hold", "release", "close"])
def test_holding_forgets_a_command_that_was_not_carried_out(
    plant: KinematicPlant, rng: np.random.Generator, act: str
) -> None:
    before = where(plant)
    plant.write(command(rng))
    getattr(plant, act)()
    if act != "close":
        plant.advance()
    for old, now in zip(before, where(plant), strict=True):
        np.testing.assert_array_equal(old, now)


def test_a_command_belongs_to_the_caller(plant: KinematicPlant, rng: np.random.Generator) -> None:
    asked = command(rng)
    expected = asked["q"][0].copy()
    plant.write(asked)
    asked["q"] = 0.0
    plant.advance()
    np.testing.assert_array_equal(where(plant)[0], expected)


def test_the_truth_goes_through_servos_and_tendons(
    configuration: Configuration, plant: KinematicPlant, rng: np.random.Generator
) -> None:
    truth = np.zeros(1, TRUTH)
    for _ in range(20):
        asked = command(rng)
        plant.write(asked)
        plant.advance()
        assert plant.truth(truth)
        uv = 3.0 * asked["servo"][0][[2, 1]]
        expected = own_kinematics.pose_at(configuration, np.array([*asked["q"][0], *uv, 0.0]))
        found = truth[0]
        np.testing.assert_allclose(found["uv"], uv, rtol=0, atol=1e-15)
        np.testing.assert_allclose(found["position"], expected.tip, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found["shaft_base"], expected.shaft_base, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found["shaft_end"], expected.shaft_end, rtol=0, atol=1e-12)
