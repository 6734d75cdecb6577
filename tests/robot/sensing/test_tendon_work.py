"""Tendons on the modes: virtual work without friction, every derivative with it."""

from __future__ import annotations

import numpy as np
import pytest

from robot.sensing.curvature_modes import MODES, U_MODE, V_MODE
from robot.sensing.tendon_work import tendon_forces, tendon_lengths_of_modes
from robot.tendons import tendon_lengths

ROUTING = (0.0018, 0.03, 2.6e-5)
LUMEN = (0.0018, 0.03, 0.0)
FRICTION = (0.15, 0.2, 1.1)
SPREAD = np.array([0.8, 0.3, 0.1, 0.05, 0.8, 0.3, 0.1, 0.05, 0.2, 0.1, 0.05])


class Work:
    """The tendons' forces and their derivatives."""

    def __init__(
        self,
        z: np.ndarray,
        tensions: np.ndarray,
        sliding: np.ndarray,
        friction: tuple[float, float, float] = FRICTION,
        routing: tuple[float, float, float] = ROUTING,
    ) -> None:
        self.force, self.per_mode = np.empty(MODES), np.empty((MODES, MODES))
        self.per_tension, self.per_sliding = np.empty((MODES, 4)), np.empty((MODES, 4))
        self.per_level = np.empty(MODES)
        tendon_forces(
            z, tensions, sliding, friction, routing,
            self.force, self.per_mode, self.per_tension, self.per_sliding, self.per_level,
        )  # fmt: skip


def lengths(z: np.ndarray, routing: tuple[float, float, float] = ROUTING) -> np.ndarray:
    out = np.empty(4)
    tendon_lengths_of_modes(z, routing[0], routing[2], out)
    return out


def test_lengths_are_those_of_the_segment(rng: np.random.Generator) -> None:
    for u, v in rng.uniform(-1.4, 1.4, size=(10, 2)):
        z, expected = np.zeros(MODES), np.empty(4)
        z[U_MODE], z[V_MODE] = u, v
        tendon_lengths(u, v, 0.0018, expected)
        assert lengths(z, LUMEN) == pytest.approx(expected, abs=1e-15)
        assert lengths(z) == pytest.approx(expected - 2.6e-5 * (u * u + v * v), abs=1e-15)


def test_without_friction_and_twist_a_tendon_works_through_its_length(
    rng: np.random.Generator,
) -> None:
    step = 1e-6
    for _ in range(20):
        z, tensions = SPREAD * rng.normal(size=MODES), rng.uniform(0.3, 4.0, 4)
        z[8:] = 0.0
        force = Work(z, tensions, np.zeros(4), (0.0, 0.0, 1.0)).force
        for a in range(8):
            moved = step * np.eye(MODES)[a]
            work = -tensions @ (lengths(z + moved) - lengths(z - moved)) / (2.0 * step)
            assert force[a] == pytest.approx(work, abs=1e-10)


def test_every_derivative_is_the_finite_difference(rng: np.random.Generator) -> None:
    step = 1e-6
    for _ in range(50):
        z, tensions = SPREAD * rng.normal(size=MODES), rng.uniform(0.3, 4.0, 4)
        sliding = rng.uniform(-1.0, 1.0, 4)
        here = Work(z, tensions, sliding)
        for a in range(MODES):
            d = step * np.eye(MODES)[a]
            slope = Work(z + d, tensions, sliding).force - Work(z - d, tensions, sliding).force
            assert here.per_mode[:, a] == pytest.approx(slope / (2.0 * step), abs=1e-9)
        for i in range(4):
            d = step * np.eye(4)[i]
            slope = Work(z, tensions + d, sliding).force - Work(z, tensions - d, sliding).force
            assert here.per_tension[:, i] == pytest.approx(slope / (2.0 * step), abs=1e-9)
            slope = Work(z, tensions, sliding + d).force - Work(z, tensions, sliding - d).force
            assert here.per_sliding[:, i] == pytest.approx(slope / (2.0 * step), abs=1e-9)
        more, less = (0.15, 0.2, 1.1 + step), (0.15, 0.2, 1.1 - step)
        slope = Work(z, tensions, sliding, more).force - Work(z, tensions, sliding, less).force
        assert here.per_level == pytest.approx(slope / (2.0 * step), abs=1e-9)


def test_a_pulled_tendon_pulls_less_than_it_shows_and_a_released_one_more() -> None:
    z, tensions = np.zeros(MODES), np.array([3.0, 0.3, 0.3, 0.3])
    z[U_MODE] = 0.8
    free = Work(z, tensions, np.zeros(4), routing=LUMEN).force[U_MODE]
    pulling = Work(z, tensions, np.array([1.0, 0, 0, 0]), routing=LUMEN).force[U_MODE]
    releasing = Work(z, tensions, np.array([-1.0, 0, 0, 0]), routing=LUMEN).force[U_MODE]
    assert 0.0 < pulling < free < releasing


def test_tension_resists_twist() -> None:
    z, tensions = np.zeros(MODES), np.full(4, 3.0)
    z[8] = 0.2
    twisting = Work(z, tensions, np.zeros(4)).force[8]
    assert twisting == pytest.approx(-12.0 * 0.0018**2 * 0.2 / 0.03)
