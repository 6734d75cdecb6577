"""Stiffness and friction from a free sweep of the independent rod, and sweeps that show nothing."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.rod.pose_noise import SensorNoise, measure
from hardware.rod.properties import RodProperties
from hardware.rod.rod import Rod
from robot.sensing.sweep_calibration import SweepUnusable, fit_stretch, fit_sweep

ROUTING = (0.0018, 0.03, 0.0)
NOISE = SensorNoise(0.1, 0.25, 0.005, 0.01)
Sweep = tuple[np.ndarray, np.ndarray, np.ndarray]


def pull_and_release(
    properties: RodProperties, noise: SensorNoise, rng: np.random.Generator
) -> Sweep:
    """Tensions, lengths and sliding shares (n, 4) of one pair after the other."""
    tensions, lengths, sliding = [], [], []
    for pulled in range(4):
        rod = Rod(properties)
        rod.step(np.full(4, 0.3))
        for level in np.concatenate([np.linspace(0.1, 3.0, 20), np.linspace(2.9, 0.2, 20)]):
            told = np.full(4, 0.3)
            told[pulled] += level
            shape = rod.step(told)
            # The bookkeeping of someone who knows the programme only: a bent pair slides.
            share = np.zeros(4)
            share[pulled], share[pulled - 2] = rod.sliding[pulled], rod.sliding[pulled - 2]
            if abs(share[pulled]) == 1.0:
                seen = measure(shape, told, noise, rng)
                tensions.append(seen.tensions)
                lengths.append(seen.lengths)
                sliding.append(share)
    return np.array(tensions), np.array(lengths), np.array(sliding)


@pytest.mark.parametrize(("stiffness", "friction"), [(1.0, 0.15), (1.07, 0.0), (0.94, 0.25)])
def test_stiffness_and_friction_are_found(
    stiffness: float, friction: float, rng: np.random.Generator
) -> None:
    true = RodProperties(bending_stiffness_n_m2=stiffness * 1.841e-4, friction=friction)
    found = fit_sweep(*pull_and_release(true, NOISE, rng), ROUTING, 1.841e-4)
    assert found.stiffness == pytest.approx(true.bending_stiffness_n_m2, rel=0.01)
    assert found.friction == pytest.approx(friction, abs=0.01)
    assert found.coulomb < 0.02
    assert (
        abs(found.stiffness / true.bending_stiffness_n_m2 - 1.0) < 4.0 * found.stiffness_deviation
    )
    assert found.residual < 2e-5


def test_a_sweep_that_shows_nothing_is_refused(rng: np.random.Generator) -> None:
    tensions, lengths, sliding = pull_and_release(RodProperties(), NOISE, rng)
    with pytest.raises(SweepUnusable, match="too short"):
        fit_sweep(tensions[:10], lengths[:10], sliding[:10], ROUTING, 1.841e-4)
    with pytest.raises(SweepUnusable, match="too short"):
        fit_sweep(tensions, 0.1 * lengths, sliding, ROUTING, 1.841e-4)
    broken = tensions.copy()
    broken[3, 2] = np.nan
    with pytest.raises(SweepUnusable, match="not a number"):
        fit_sweep(broken, lengths, sliding, ROUTING, 1.841e-4)
    with pytest.raises(SweepUnusable, match="no stiffness"):
        fit_sweep(50.0 * tensions, lengths, sliding, ROUTING, 1.841e-4)


def test_stretch_and_pretension_are_found(rng: np.random.Generator) -> None:
    pretension, stiffness = np.array([1.8, 2.0, 2.1, 1.9]), 7500.0
    lengths = 1e-3 * rng.uniform(-2.0, 2.0, size=(200, 4))
    tensions = rng.uniform(0.2, 4.0, size=(200, 4))
    taken_up = lengths - (tensions - pretension) / stiffness
    taken_up += 5e-6 * rng.normal(size=(200, 4))
    found, straight = fit_stretch(taken_up, lengths, tensions)
    assert found == pytest.approx(stiffness, rel=0.01)
    assert straight == pytest.approx(pretension, abs=0.02)
    with pytest.raises(SweepUnusable, match="stretch"):
        fit_stretch(taken_up, taken_up, tensions)
