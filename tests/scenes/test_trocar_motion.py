"""A breathing trocar: smooth whatever is changed, and still when nothing breathes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenes.trocar_motion import Breathing, TrocarMotion

DEEP = Breathing(0.005, 4.0)


def breaths(changes: list[tuple[float, Breathing]]) -> TrocarMotion:
    motion = TrocarMotion()
    for time_s, breathing in changes:
        motion = motion.changed(breathing, time_s)
    return motion


def test_a_breath_goes_out_by_the_amplitude_and_comes_back() -> None:
    motion = breaths([(10.0, DEEP)])
    assert motion.displacement(10.0) == 0.0
    assert motion.velocity(10.0) == 0.0
    assert motion.displacement(12.0) == pytest.approx(0.005)
    assert motion.displacement(14.0) == pytest.approx(0.0, abs=1e-15)
    times = np.linspace(10.0, 18.0, 801)
    out = np.array([motion.displacement(time_s) for time_s in times])
    assert out.min() >= 0.0
    assert out.max() == pytest.approx(0.005)


def test_the_velocity_is_the_derivative() -> None:
    motion = breaths([(3.3, DEEP), (5.0, Breathing(0.008, 2.5))])
    step = 1e-5
    for time_s in np.linspace(3.5, 20.0, 200):
        numerical = (motion.displacement(time_s + step) - motion.displacement(time_s - step)) / (
            2.0 * step
        )
        assert motion.velocity(time_s) == pytest.approx(numerical, abs=1e-7)


def test_whatever_is_changed_place_and_velocity_never_jump() -> None:
    rng = np.random.default_rng(4)
    motion, step = TrocarMotion(), 0.002
    bound = 0.5 * 0.01 * (2.0 * math.pi / 1.5) ** 2
    place = speed = 0.0
    for tick in range(15_000):
        time_s = tick * step
        if rng.uniform() < 0.002:
            still = rng.uniform() < 0.3
            wanted = Breathing(0.0 if still else rng.uniform(0.0, 0.01), rng.uniform(1.5, 6.0))
            motion = motion.changed(wanted, time_s)
            assert motion.wanted() == wanted
        now, velocity = motion.displacement(time_s), motion.velocity(time_s)
        assert abs(now - place - 0.5 * step * (velocity + speed)) < 1e-7
        assert abs(velocity - speed) <= bound * step * 1.01
        place, speed = now, velocity


def test_a_change_waits_for_the_next_breath_and_the_last_one_counts() -> None:
    motion = breaths([(0.0, DEEP), (1.0, Breathing(0.002, 3.0)), (2.0, Breathing(0.0, 4.0))])
    assert motion.displacement(2.0) == pytest.approx(0.005)
    for time_s in (4.0, 5.0, 400.0):
        assert motion.displacement(time_s) == 0.0
        assert motion.velocity(time_s) == 0.0


def test_a_trocar_that_does_not_breathe_is_exactly_still() -> None:
    motion = TrocarMotion().changed(Breathing(0.0, 7.0), 1.0)
    for time_s in np.linspace(0.0, 100.0, 57):
        assert motion.displacement(time_s) == 0.0
        assert motion.velocity(time_s) == 0.0
