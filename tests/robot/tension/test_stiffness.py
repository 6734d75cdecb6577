"""Stiffness against the energy's differences, and its modulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from robot.tension.distribution import BoundsRefused, TensionInfeasible, least_tension
from robot.tension.stiffness import (
    StiffnessOutOfReach,
    chord_curvatures,
    co_contraction_range,
    hardened,
    joint_stiffness,
    stiffen,
    stiffen_to,
)
from robot.tension.structures import (
    Structure,
    four_rods,
    four_tendons,
    three_tendons,
    three_tendons_and_rod,
)

RADIUS = 1.8e-3
LENGTH = 0.03
BACKBONE = 1.841e-4 / LENGTH
CHORD = LENGTH / (8.0 * 10**2)
SOFT = 4000.0
HARDENING = 450.0
LOWER, UPPER = np.full(4, 0.3), np.full(4, 30.0)
FOUR = four_tendons(RADIUS)


def _energy(structure: Structure, x: np.ndarray, held: np.ndarray) -> float:
    """Of backbone and tendons with tau = (SOFT / h) (exp(h e) - 1), whose stiffness hardens."""
    stretch = -structure.matrix.T @ x - CHORD * (x @ x) - held
    strain = (np.expm1(HARDENING * stretch) / HARDENING - stretch) * SOFT / HARDENING
    return float(0.5 * BACKBONE * (x @ x) + strain.sum())


@pytest.mark.parametrize("structure", [FOUR, three_tendons(RADIUS)], ids=lambda s: s.name)
def test_against_differences_of_the_energy(structure: Structure, rng: np.random.Generator) -> None:
    count = len(structure.actuators)
    for _ in range(20):
        x, tensions = rng.uniform(-1.0, 1.0, 2), rng.uniform(0.5, 10.0, count)
        stretch = np.log1p(tensions * HARDENING / SOFT) / HARDENING
        held = -structure.matrix.T @ x - CHORD * (x @ x) - stretch
        step, numbers = 1e-3, np.empty((2, 2))
        for a in range(2):
            for b in range(2):
                at = [
                    _energy(structure, x + step * (i * np.eye(2)[a] + j * np.eye(2)[b]), held)
                    for i, j in ((1, 1), (1, -1), (-1, 1), (-1, -1))
                ]
                numbers[a, b] = (at[0] - at[1] - at[2] + at[3]) / (4.0 * step**2)
        # At a bend the chords change the tendons' arms, too.
        arms = structure.matrix + 2.0 * CHORD * x[:, None]
        bent = Structure("bent", arms, structure.pull_only, ("u", "v"), structure.actuators)
        stiffness = joint_stiffness(
            bent,
            tensions,
            hardened(np.full(count, SOFT), HARDENING, tensions),
            chord_curvatures(structure, CHORD),
            BACKBONE * np.eye(2),
        )
        np.testing.assert_allclose(stiffness, numbers, rtol=1e-4, atol=1e-6)


def test_chords_change_lengths_as_stated() -> None:
    curvatures = chord_curvatures(three_tendons_and_rod(RADIUS, 1e-3), CHORD)
    assert curvatures.shape == (4, 3, 3)
    np.testing.assert_array_equal(curvatures[0], np.diag([-2.0 * CHORD, -2.0 * CHORD, 0.0]))
    assert not curvatures[3].any()


def _both(hardening: float, chord: float, tensions: np.ndarray) -> np.ndarray:
    """Least and largest stiffness over the directions of bending."""
    stiffness = joint_stiffness(
        FOUR,
        tensions,
        hardened(np.full(4, SOFT), hardening, tensions),
        chord_curvatures(FOUR, chord),
        BACKBONE * np.eye(2),
    )
    return np.asarray(np.linalg.eigvalsh(stiffness))


def _least(hardening: float, chord: float, tensions: np.ndarray) -> float:
    return float(_both(hardening, chord, tensions)[0])


def _levels(tensions: np.ndarray) -> np.ndarray:
    return np.linspace(*co_contraction_range(FOUR, tensions, LOWER, UPPER), 25)


@pytest.mark.parametrize(
    "structure", [FOUR, three_tendons(RADIUS), three_tendons_and_rod(RADIUS, 1e-3)]
)
def test_the_force_stays_and_the_mean_is_the_level(
    structure: Structure, rng: np.random.Generator
) -> None:
    lower = np.where(structure.pull_only, 0.3, -30.0)
    upper = np.full(len(lower), 30.0)
    for _ in range(20):
        tensions = rng.uniform(lower, upper)
        low, high = co_contraction_range(structure, tensions, lower, upper)
        for level in (low, rng.uniform(low, high), high):
            found = stiffen(structure, tensions, level, lower, upper)
            np.testing.assert_allclose(
                structure.matrix @ found, structure.matrix @ tensions, atol=1e-11, rtol=0.0
            )
            assert found[structure.pull_only].mean() == pytest.approx(level, abs=1e-8)
            assert (found >= lower).all()
            assert (found <= upper).all()


def test_the_range_is_that_of_the_linear_program(rng: np.random.Generator) -> None:
    for _ in range(10):
        tensions = rng.uniform(LOWER, UPPER)
        for sign, end in zip(
            (1.0, -1.0), co_contraction_range(FOUR, tensions, LOWER, UPPER), strict=True
        ):
            found = linprog(
                np.full(4, 0.25 * sign),
                A_eq=FOUR.matrix / RADIUS,
                b_eq=FOUR.matrix @ tensions / RADIUS,
                bounds=np.column_stack([LOWER, UPPER]),
            )
            assert end == pytest.approx(sign * found.fun, abs=1e-7)


def test_a_level_beyond_the_bounds_goes_as_far_as_they_permit(rng: np.random.Generator) -> None:
    tensions = rng.uniform(LOWER, UPPER)
    low, high = co_contraction_range(FOUR, tensions, LOWER, UPPER)
    assert stiffen(FOUR, tensions, 1e3, LOWER, UPPER).mean() == pytest.approx(high, abs=1e-8)
    assert stiffen(FOUR, tensions, 0.0, LOWER, UPPER).mean() == pytest.approx(low, abs=1e-8)


@pytest.mark.parametrize(
    ("hardening", "chord", "sign"), [(450.0, CHORD, 1), (450.0, 0.0, 1), (0.0, CHORD, -1)]
)
def test_stiffness_follows_the_level_as_the_formula_says(
    hardening: float, chord: float, sign: int, rng: np.random.Generator
) -> None:
    """Tendons that harden stiffen; chords alone soften.

    The sum over the directions does so all the way. The weaker direction does until a tendon is at
    its upper bound: from there on only the other pair can be tightened, and its chords soften.
    """
    for _ in range(5):
        tensions = rng.uniform(LOWER, 0.5 * UPPER)
        found = [stiffen(FOUR, tensions, level, LOWER, UPPER) for level in _levels(tensions)]
        values = np.array([_both(hardening, chord, at) for at in found])
        assert (sign * np.diff(values.sum(axis=1)) > 1e-6).all()
        within = np.array([at.max() < UPPER[0] - 1e-9 for at in found])
        assert within.sum() > 5
        assert (sign * np.diff(values[within, 0]) > -1e-12).all()
        if hardening == 0.0 or chord == 0.0:
            assert (sign * np.diff(values, axis=0) > -1e-12).all()


def test_linear_tendons_without_chords_cannot_be_modulated(rng: np.random.Generator) -> None:
    tensions = rng.uniform(LOWER, UPPER)
    values = [
        _least(0.0, 0.0, stiffen(FOUR, tensions, level, LOWER, UPPER))
        for level in _levels(tensions)
    ]
    np.testing.assert_allclose(values, values[0], rtol=1e-12)


def test_a_wanted_stiffness_is_met(rng: np.random.Generator) -> None:
    tensions = rng.uniform(LOWER, 0.5 * UPPER)

    def stiffness_of(at: np.ndarray) -> float:
        return _least(HARDENING, CHORD, at)

    ends = co_contraction_range(FOUR, tensions, LOWER, UPPER)
    lowest, highest = (stiffness_of(stiffen(FOUR, tensions, e, LOWER, UPPER)) for e in ends)
    for share in (0.0, 0.3, 0.8):
        wanted = lowest + share * (highest - lowest)
        found = stiffen_to(FOUR, tensions, wanted, stiffness_of, LOWER, UPPER)
        assert stiffness_of(found) == pytest.approx(wanted, rel=1e-8)
        np.testing.assert_allclose(FOUR.matrix @ found, FOUR.matrix @ tensions, atol=1e-11)
    with pytest.raises(StiffnessOutOfReach, match="widen the bounds") as caught:
        stiffen_to(FOUR, tensions, 2.0 * highest, stiffness_of, LOWER, UPPER)
    assert highest <= caught.value.highest < 2.0 * highest
    assert caught.value.lowest == pytest.approx(lowest)
    assert caught.value.code == "stiffness_out_of_reach"


def test_without_redundancy_nothing_changes(rng: np.random.Generator) -> None:
    rods, tensions = four_rods(RADIUS), rng.uniform(-5.0, 5.0, 4)
    lower, upper = np.full(4, -9.0), np.full(4, 9.0)
    np.testing.assert_allclose(stiffen(rods, tensions, 7.0, lower, upper), tensions, atol=1e-11)
    assert co_contraction_range(rods, tensions, lower, upper) == (0.0, 0.0)


def test_forces_beyond_the_bounds_and_endless_ranges_are_refused() -> None:
    far = np.array([99.0, 0.0, 0.0, 0.0])
    with pytest.raises(TensionInfeasible):
        stiffen(FOUR, far, 5.0, LOWER, UPPER)
    with pytest.raises(BoundsRefused, match="finite"):
        co_contraction_range(FOUR, LOWER, LOWER, np.full(4, np.inf))
    found = stiffen(FOUR, LOWER, 1e3, LOWER, np.full(4, np.inf))
    np.testing.assert_allclose(found, 1e3)


def test_at_its_lowest_level_it_is_the_least_tension(rng: np.random.Generator) -> None:
    tensions = rng.uniform(LOWER, UPPER)
    found = stiffen(FOUR, tensions, 0.0, LOWER, UPPER)
    least = least_tension(FOUR, FOUR.matrix @ tensions, LOWER, UPPER)
    np.testing.assert_allclose(found, least, atol=1e-7)
