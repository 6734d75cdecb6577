"""Friction of the rod's tendons: what it costs, what it remembers, and its closed form."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from hardware.rod.properties import RodProperties
from hardware.rod.rod import Rod, RodShape, solve_rod
from hardware.rod.tendons import TendonState, tensions_along
from tests.hardware.rod.loads import PRETENSION, pulling, stiffness_per_rad

ROD = RodProperties()
SMOOTH = replace(ROD, friction=0.0)
ONE_RADIAN = stiffness_per_rad(ROD)


def sweep(rod: Rod, amplitudes: np.ndarray, direction: float = 0.0) -> list[RodShape]:
    return [rod.step(pulling(amplitude, direction)) for amplitude in amplitudes]


def work(shapes: list[RodShape], tensions: list[np.ndarray]) -> float:
    """Work done on the rod by tensions and tip forces, J, by the trapezium rule."""
    done = 0.0
    for (one, pull), (other, pull_after) in itertools.pairwise(zip(shapes, tensions, strict=True)):
        done -= 0.5 * (pull + pull_after) @ (other.lengths - one.lengths)
        done += 0.5 * (one.force + other.force) @ (other.tip_position - one.tip_position)
    return done


def elastic_energy(properties: RodProperties, shape: RodShape) -> float:
    stiffness = np.array([properties.bending_stiffness_n_m2] * 2)
    stiffness = np.append(stiffness, properties.torsion_stiffness_n_m2)
    density = 0.5 * shape.curvatures**2 @ stiffness
    step = properties.length_m / (len(density) - 1)
    # Simpson's rule, as accurate as the integration.
    weights = np.ones(len(density))
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    return float(weights @ density) * step / 3.0


def loop(turns: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Tensions and tip forces that go once around, none of them in step with another."""
    phases = np.array([0.3, 1.9, 3.1, 5.0])
    tensions = [1.5 + 1.2 * np.sin(turn + phases) for turn in turns]
    forces = [
        0.1 * np.array([math.cos(turn + 1.0), math.sin(2.0 * turn), 0.5 * math.sin(turn)])
        for turn in turns
    ]
    return tensions, forces


@pytest.mark.parametrize("direction", [0.0, 37.0])
def test_pulling_is_stiffer_and_releasing_softer_than_without_friction(direction: float) -> None:
    """Slopes of difference of tension by bend, beside EI / (L r): reference 1.087 and 0.911."""
    delta = math.radians(direction)
    up = np.linspace(0.0, ONE_RADIAN, 41)
    rod = Rod(ROD)
    pulled, released = sweep(rod, up, delta), sweep(rod, up[::-1], delta)

    def slope(amplitudes: np.ndarray, shapes: list[RodShape], share: float) -> float:
        slides = [bool(np.all(shape.sliding[[0, 2]] == [share, -share])) for shape in shapes]
        bends = np.array([shape.bends[-1] for shape in shapes])
        return float(np.polyfit(bends[slides], amplitudes[slides], 1)[0]) / ONE_RADIAN

    assert slope(up, pulled, 1.0) == pytest.approx(1.09, abs=0.01)
    assert slope(up[::-1], released, -1.0) == pytest.approx(0.92, abs=0.01)
    smooth = sweep(Rod(SMOOTH), up, delta)
    assert slope(up, smooth, 1.0) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("pulls", [True, False])
def test_a_free_pull_and_a_release_follow_their_closed_form(pulls: bool) -> None:
    """The bend's rate by length is r (T_0 exp(-f mu phi) - T_2 exp(f mu phi)) / EI."""
    rod = Rod(ROD)
    amplitude = 2.5
    rod.step(pulling(amplitude if pulls else 4.0, 0.0))
    shape = rod.step(pulling(amplitude, 0.0))
    sign = 1.0 if pulls else -1.0
    np.testing.assert_array_equal(shape.sliding[[0, 2]], [sign, -sign])
    near, far = PRETENSION + amplitude, PRETENSION
    ratio, rate = math.sqrt(far / near), sign * ROD.friction
    length = ROD.length_m * ROD.pitch_radius_m / ROD.bending_stiffness_n_m2
    # Substituting x = exp(f mu phi) makes it d x / (T_0 - T_2 x^2).
    end = math.tanh(math.atanh(ratio) + rate * length * math.sqrt(near * far)) / ratio
    assert shape.bends[-1] == pytest.approx(math.log(end) / rate, rel=1e-9)


def test_a_sliding_tendon_loses_tension_as_a_capstan() -> None:
    bends, sliding = np.linspace(0.0, 1.2, 5), np.array([1.0, 0.0, -1.0, 0.5])
    along = tensions_along(ROD, np.array([2.0, 2.0, 2.0, 0.0]), sliding, bends)
    np.testing.assert_allclose(along[:, 0], 2.0 * np.exp(-0.15 * bends))
    np.testing.assert_allclose(along[:, 1], 2.0)
    np.testing.assert_allclose(along[:, 2], 2.0 * np.exp(0.15 * bends))
    np.testing.assert_array_equal(along[:, 3], 0.0)


def test_without_friction_a_closed_loop_of_loads_costs_nothing() -> None:
    turns = np.linspace(0.0, 2.0 * math.pi, 97)
    tensions, forces = loop(turns)
    rod = Rod(SMOOTH)
    shapes = [rod.step(pull, force) for pull, force in zip(tensions, forces, strict=True)]
    third = len(turns) // 3
    there = work(shapes[: third + 1], tensions[: third + 1])
    assert abs(there) > 1e-4
    # What is left around the loop is the polygon's, and falls as the square of its sides.
    coarse, fine = work(shapes[::2], tensions[::2]), work(shapes, tensions)
    assert abs(fine) < 1e-3 * abs(there)
    assert abs(4.0 * fine - coarse) / 3.0 < 1e-5 * abs(there)
    # On the way, all of the work is in the bent and twisted backbone.
    stored = elastic_energy(SMOOTH, shapes[third]) - elastic_energy(SMOOTH, shapes[0])
    assert there == pytest.approx(stored, rel=2e-3)


def test_without_friction_the_shape_does_not_depend_on_the_way() -> None:
    tensions, forces = loop(np.array([0.0, 1.0, 2.5]))
    rod = Rod(SMOOTH)
    for pull, force in zip(tensions, forces, strict=True):
        shape = rod.step(pull, force)
    alone = solve_rod(SMOOTH, tensions[-1], np.zeros(4), forces[-1])
    np.testing.assert_allclose(shape.positions, alone.positions, atol=1e-10)


@pytest.mark.parametrize("friction", [0.05, 0.15, 0.3])
def test_friction_costs_work_around_a_loop(friction: float) -> None:
    turns = np.linspace(0.0, 4.0 * math.pi, 129)
    tensions, forces = loop(turns)
    rod = Rod(replace(ROD, friction=friction))
    shapes = [rod.step(pull, force) for pull, force in zip(tensions, forces, strict=True)]
    second = slice(64, 129)
    # After the first turn the loop closes, and it takes work every time.
    np.testing.assert_allclose(shapes[64].positions, shapes[-1].positions, atol=1e-6)
    lost = work(shapes[second], tensions[second])
    assert 0.5 * friction * 1e-3 < lost < 10.0 * friction * 1e-3


def test_the_bend_lags_behind_on_both_ways() -> None:
    up = np.linspace(0.0, ONE_RADIAN, 30)
    rod = Rod(ROD)
    pulled, released = sweep(rod, up), sweep(rod, up[::-1])[::-1]
    smooth = sweep(Rod(SMOOTH), up)
    for going, coming, free in list(zip(pulled, released, smooth, strict=True))[2:-5]:
        assert going.bends[-1] < free.bends[-1] < coming.bends[-1]


def test_shares_turn_only_with_the_travel() -> None:
    rod = Rod(ROD)
    np.testing.assert_array_equal(rod.sliding, 0.0)
    rod.step(np.full(4, PRETENSION))
    np.testing.assert_allclose(rod.sliding, 0.0, atol=1e-9)  # nothing has moved
    rod.step(pulling(2.0, 0.0))
    np.testing.assert_allclose(rod.sliding, [1.0, 0.0, -1.0, 0.0], atol=1e-9)
    before = rod.shape
    less = rod.step(pulling(1.98, 0.0))
    travel = less.lengths[0] - before.lengths[0]
    assert 0.0 < travel < ROD.stick_m
    assert less.sliding[0] == pytest.approx(1.0 - travel / ROD.stick_m, abs=1e-8)
    rod.step(pulling(1.0, 0.0))
    np.testing.assert_allclose(rod.sliding, [-1.0, 0.0, 1.0, 0.0], atol=1e-9)


def test_a_shape_and_its_shares_agree_with_each_other(rng: np.random.Generator) -> None:
    rod = Rod(ROD)
    for force in 0.03 * rng.normal(size=(20, 3)):
        tensions = np.clip(rng.normal(1.0, 0.7, 4), 0.0, None)
        shape = rod.step(tensions, force)
        alone = solve_rod(ROD, tensions, shape.sliding, force, guess=shape)
        np.testing.assert_allclose(shape.positions, alone.positions, atol=1e-9)
        np.testing.assert_allclose(shape.lengths, alone.lengths, atol=1e-10)
        assert np.abs(shape.sliding).max() <= 1.0


def test_shares_follow_the_travel_of_a_step(rng: np.random.Generator) -> None:
    rod = Rod(ROD)
    tensions = np.full(4, 1.0)
    for size in (1e-3, 0.02, 1.0) * 10:
        before = TendonState(rod.sliding, rod.shape.lengths)
        tensions = np.clip(tensions + size * rng.normal(size=4), 0.0, 3.0)
        shape = rod.step(tensions)
        reached = before.reached(shape.lengths, ROD.stick_m)
        np.testing.assert_allclose(shape.sliding, np.clip(reached, -1.0, 1.0), atol=1e-9)
        far = np.abs(shape.lengths - before.lengths) > 2.0 * ROD.stick_m
        expected = -np.sign(shape.lengths - before.lengths)
        np.testing.assert_array_equal(shape.sliding[far], expected[far])


def test_one_large_step_is_as_good_as_many_small_ones() -> None:
    at_once, slowly = Rod(ROD), Rod(ROD)
    last = 0.0
    for amplitude in (3.0, 0.5, 2.0):
        shape = at_once.step(pulling(amplitude, 0.4))
        small = sweep(slowly, np.linspace(last, amplitude, 41), 0.4)[-1]
        np.testing.assert_allclose(small.positions, shape.positions, atol=1e-9)
        np.testing.assert_allclose(small.sliding, shape.sliding, atol=1e-6)
        last = amplitude


def test_a_step_in_which_the_travel_turns_remembers_the_turn() -> None:
    """The force pushes the rod over first, then the tension pulls it half back."""
    begin, end, force = np.full(4, 0.3), np.array([4.0, 0.3, 0.3, 0.3]), np.array([-0.5, 0.0, 0.0])
    at_once, slowly = Rod(ROD), Rod(ROD)
    for rod in (at_once, slowly):
        rod.step(begin)
    at_once.step(end, force)
    for way in np.linspace(0.0, 1.0, 101):
        slowly.step((1.0 - way) * begin + way * end, way * force)
    assert -0.95 < slowly.sliding[0] < -0.8
    np.testing.assert_allclose(at_once.sliding, slowly.sliding, atol=0.01)


def test_the_slack_of_stiction_hardly_matters_where_all_slides() -> None:
    bends = []
    for stick in (5e-6, 20e-6, 50e-6):
        rod = Rod(replace(ROD, stick_m=stick))
        bends.append(float(sweep(rod, np.linspace(0.0, 3.0, 12))[-1].bends[-1]))
    np.testing.assert_allclose(bends, bends[1], rtol=1e-9)
