"""Servos and joints of the physics plant: ticks, speeds, lags, and the arm's sag."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.physics.preset import HARSH, PAPER, PRESETS, Preset
from tests import own_kinematics
from tests.hardware import physics_robot as here


@pytest.mark.parametrize("preset", ["paper", "harsh"])
def test_servos_stand_at_whole_ticks(preset: str, rng: np.random.Generator) -> None:
    plant = here.physics(preset)
    for _ in range(200):
        plant.write(here.command(here.start()[:7], rng.uniform(-0.4, 0.4, 4)))
        plant.advance()
        ticks = plant.read().servo / here.TICK
        np.testing.assert_allclose(ticks, np.rint(ticks), rtol=0, atol=1e-9)


@pytest.mark.parametrize("preset", list(PRESETS))
def test_servos_come_to_their_command_no_faster_than_they_can(preset: str) -> None:
    plant = here.physics(preset, x=here.standing_straight())
    wanted = np.array([-0.5, 0.3, 0.5, -0.3])
    plant.write(here.command(here.start()[:7], wanted))
    before, fastest = plant.read().servo.copy(), 0.0
    for _ in range(round(0.6 / here.DT)):
        plant.advance()
        now = plant.read().servo.copy()
        fastest = max(fastest, float(np.abs(now - before).max()))
        before = now
    chosen = PRESETS[preset]
    tick = here.TICK if chosen.servo_ticks else 0.0
    assert fastest <= chosen.servo_speed_rad_s * here.DT + tick + 1e-12
    assert fastest > 0.8 * chosen.servo_speed_rad_s * here.DT
    np.testing.assert_allclose(before, wanted, rtol=0, atol=0.5 * tick + 1e-6)


def lag(values: np.ndarray, step: float) -> float:
    """Time constant of a response (n,) to a ``step``: the area above it, s."""
    return float(np.sum(1.0 - (values - values[0]) / step) * here.DT)


@pytest.mark.parametrize("preset", [PAPER, HARSH], ids=lambda preset: preset.name)
def test_every_joint_follows_with_a_lag_of_its_own(preset: Preset) -> None:
    plant = here.physics(preset.name, x=here.standing_straight())
    q, servo = here.start()[:7].copy(), here.servos(0.0, 0.0)
    for joint, expected in enumerate(preset.joint_lag_s):
        q[joint] += 0.002
        plant.write(here.command(q, servo))
        values = [plant.read().q[joint]]
        for _ in range(round(0.8 / here.DT)):
            plant.advance()
            values.append(plant.read().q[joint])
        found = lag(np.array(values), 0.002) - 0.5 * here.DT
        assert found == pytest.approx(expected, rel=0.15, abs=here.DT)
        assert max(values) < q[joint] + 0.5 * 0.002


@pytest.mark.parametrize("preset", list(PRESETS))
def test_the_arm_sags_by_the_weight_that_it_does_not_know_of(preset: str) -> None:
    plant = here.physics(preset)
    off = plant.read().q - here.start()[:7]
    told = own_kinematics.flange(here.start()[:7])[2, 3]
    sag = told - own_kinematics.flange(plant.read().q)[2, 3]
    if preset == "ideal":
        assert np.abs(off).max() < 1e-6
        return
    assert 1e-6 < np.abs(off).max() < 1e-3
    assert 1e-6 < sag < 1e-3
    # In a straight line: three times the weight on half the stiffness.
    if preset == "harsh":
        paper = here.physics("paper").read().q - here.start()[:7]
        assert np.abs(off).max() == pytest.approx(6.0 * np.abs(paper).max(), rel=0.1)


def test_holding_forgets_a_command_that_was_not_carried_out() -> None:
    plant = here.physics("paper")
    before = plant.read().q.copy()
    plant.write(here.command(here.start()[:7] + 0.1, here.servos(0.0, 0.0)))
    plant.hold()
    here.wait(plant, 0.3)
    np.testing.assert_allclose(plant.read().q, before, rtol=0, atol=1e-6)
    assert here.bend_deg(plant)[0] > 50.0


def test_a_command_belongs_to_the_caller() -> None:
    plant = here.physics("ideal")
    q = here.start()[:7] + 0.01
    asked = here.command(q, here.servos(1.0, 0.0))
    plant.write(asked)
    asked["q"] = 0.0
    here.wait(plant, 0.3)
    np.testing.assert_allclose(plant.read().q, q, rtol=0, atol=1e-6)


def test_it_says_what_it_is() -> None:
    plant = here.physics("paper")
    assert (plant.spec.name, plant.spec.simulated) == ("physics", True)
    assert plant.spec.tick_ns == round(here.DT * 1e9)
    assert len(plant.spec.actuators) == 11
    assert plant.read().valid
