"""The fit of gain, offset and friction finds what a sweep was made with."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.sensing.tendon_fit import FEWEST_SAMPLES, SweepTooPoor, bend_of, fit
from server.calibration.sweep import sweep_bends
from tests import own_kinematics

DT = 0.008
EVERY = 3
MADE_WITH = [
    ((0.95, 0.94), (0.01, -0.02), (0.036, 0.030), (0.012, 0.015)),
    ((0.80, 0.85), (-0.05, 0.03), (0.080, 0.100), (0.030, 0.050)),
    ((1.00, 1.00), (0.00, 0.00), (0.010, 0.000), (0.020, 0.020)),
]


def bends_under(
    told: np.ndarray, gain: float, offset: float, friction: float, stick: float
) -> np.ndarray:
    """(n,) bend of one coordinate whose friction element sticks, then slides (n told bends, rad).

    While it sticks the bend gives way elastically; beyond full friction it slides.
    """
    bends, bend, share = np.empty_like(told), offset + gain * told[0], 0.0
    for index, one in enumerate(told):
        free = offset + gain * one
        sticking = (free - friction * (share - bend / stick)) / (1.0 + friction / stick)
        trial = share + (sticking - bend) / stick
        after = min(max(trial, -1.0), 1.0)
        bend = sticking if after == trial else free - friction * after
        share = after
        bends[index] = bend
    return bends


def sweep() -> np.ndarray:
    return sweep_bends(0.5 * math.pi, np.array([1.0, 0.0]), DT)


@pytest.mark.parametrize("made_with", MADE_WITH)
def test_what_a_sweep_was_made_with_is_found(
    made_with: tuple[tuple[float, float], ...], rng: np.random.Generator
) -> None:
    told = sweep()
    bends = np.column_stack(
        [bends_under(told[:, axis], *(part[axis] for part in made_with)) for axis in range(2)]
    )
    seen_at = np.arange(0, len(told), EVERY)
    noise = math.radians(0.2)
    seen = bends[seen_at] + rng.normal(0.0, noise, (len(seen_at), 2))
    for axis, found in enumerate(fit(told, seen_at, seen, 0.0)):
        gain, offset, friction, stick = (part[axis] for part in made_with)
        assert found.gain == pytest.approx(gain, abs=0.002)
        assert found.offset == pytest.approx(offset, abs=0.002)
        assert found.friction == pytest.approx(friction, abs=0.003)
        if friction > 0.02:
            assert found.stick == pytest.approx(stick, rel=0.4)
        assert found.residual == pytest.approx(noise, rel=0.1)


def test_a_perfect_sweep_leaves_nothing_over() -> None:
    told = sweep()
    seen_at = np.arange(0, len(told), EVERY)
    for found in fit(told, seen_at, told[seen_at], 0.0):
        assert found.gain == pytest.approx(1.0, abs=1e-4)
        assert found.offset == pytest.approx(0.0, abs=1e-4)
        assert found.friction < 1e-4
        assert found.residual < 1e-4


def test_the_same_sweep_gives_the_same_fit(rng: np.random.Generator) -> None:
    told = sweep()
    seen_at = np.arange(0, len(told), EVERY)
    seen = 0.9 * told[seen_at] + rng.normal(0.0, 0.003, (len(seen_at), 2))
    assert fit(told, seen_at, seen, 0.0145) == fit(told, seen_at, seen, 0.0145)


@pytest.mark.parametrize("samples", [0, 1, FEWEST_SAMPLES - 1])
def test_too_few_samples_are_refused(samples: int) -> None:
    told = sweep()
    seen_at = np.linspace(0, len(told) - 1, samples).astype(int)
    with pytest.raises(SweepTooPoor, match=f"^{samples} samples .*at least {FEWEST_SAMPLES}"):
        fit(told, seen_at, told[seen_at], 0.0)


@pytest.mark.parametrize("still", [0, 1])
def test_too_little_motion_of_either_coordinate_is_refused(still: int) -> None:
    told = sweep()
    told[:, still] *= 0.05
    seen_at = np.arange(0, len(told), EVERY)
    with pytest.raises(SweepTooPoor, match="check the tracker and that the servos move"):
        fit(told, seen_at, told[seen_at], 0.0)


def test_the_bend_of_a_tip_axis(rng: np.random.Generator) -> None:
    axes, bends = [], []
    for _ in range(100):
        phi, delta = rng.uniform(0.0, 3.0), rng.uniform(-math.pi, math.pi)
        _, turn = own_kinematics.segment(0.5 * math.pi - phi, delta, 0.03)
        axes.append(turn[:, 2])
        bends.append([phi * math.cos(delta), phi * math.sin(delta)])
    np.testing.assert_allclose(bend_of(np.array(axes)), bends, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(bend_of(np.array([[0.0, 0.0, 1.0]])), [[0.0, 0.0]])


def test_the_sweep_is_slow_whole_and_within_the_limit() -> None:
    limit, dt = 0.5 * math.pi, 0.002
    bends = sweep_bends(limit, np.array([1.0, 0.2]), dt)
    np.testing.assert_allclose(bends[0], [1.0, 0.2], rtol=0, atol=1e-12)
    assert np.hypot(*bends[-1]) < 0.01
    assert np.hypot(*bends.T).max() < limit
    assert np.hypot(*np.diff(bends, axis=0).T).max() / dt < math.radians(41.0)
    for axis in range(2):
        assert bends[:, axis].max() > 0.8 * limit
        assert bends[:, axis].min() < -0.8 * limit
