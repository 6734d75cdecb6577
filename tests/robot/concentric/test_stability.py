"""When tubes snap: against the analytic determinant, and along paths."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.concentric.kinematics import SINGULAR, SOLVED, solve_cold
from robot.concentric.stability import BranchFollower, TubesSnap, first_snap
from robot.concentric.tubes import InvalidTubeConfiguration, TubeOutOfBounds
from tests.robot.concentric.arm_solution import (
    FOUR_TUBES,
    configuration,
    random_configuration,
    solve,
    tubes_like,
)

THREE = FOUR_TUBES[:3]
EQUAL_ENDS = tubes_like(FOUR_TUBES[:2], length=[0.4, 0.3], straight_length=[0.35, 0.25])
"""Two tubes whose curved parts, 50 mm, overlap in full where tube 1 is 100 mm behind tube 2."""


def opposite(translation: float) -> np.ndarray:
    return np.array([translation - 0.1, translation, math.pi, 0.0])


def analytic(translation: float, sign: float) -> float:
    """Determinant of ``EQUAL_ENDS``; sign 1 where the tubes are aligned, −1 where opposite."""
    ei, gj = EQUAL_ENDS["bending_stiffness"], EQUAL_ENDS["torsional_stiffness"]
    bends = ei * EQUAL_ENDS["curvature"]
    couplings = bends[0] * bends[1] / (ei.sum() * gj)
    overlap = min(0.05, translation + 0.3)
    twisting = np.array([0.35, 0.25]) + max(0.0, -(translation + 0.25))
    wave = math.sqrt(couplings.sum())
    if sign > 0.0:
        c, s = math.cosh(wave * overlap), math.sinh(wave * overlap)
    else:
        c, s = math.cos(wave * overlap), math.sin(wave * overlap)
    return float(c + sign * (couplings @ twisting) * s / wave)


@pytest.mark.parametrize("translation", [-0.299, -0.29, -0.27, -0.2, -0.1, 0.0])
def test_determinant_of_two_opposite_tubes(translation: float) -> None:
    solution = solve(opposite(translation), EQUAL_ENDS, np.zeros(2))
    assert solution.status == SOLVED
    assert np.max(np.abs(solution.torsion)) < 1e-10
    assert solution.stability == pytest.approx(analytic(translation, -1.0), abs=1e-11)


@pytest.mark.parametrize("translation", [-0.29, -0.2, 0.0])
def test_determinant_of_two_aligned_tubes(translation: float) -> None:
    q = np.array([translation - 0.1, translation, 0.3, 0.3])
    solution = solve(q, EQUAL_ENDS, np.zeros(2))
    assert solution.stability == pytest.approx(analytic(translation, 1.0), abs=1e-11)
    assert solution.stability > 1.0


def test_it_is_one_where_nothing_twists(rng: np.random.Generator) -> None:
    straight = tubes_like(THREE, curvature=[10.0, 0.0, 0.0])
    for _ in range(10):
        q = random_configuration(straight, rng)
        assert solve(q, straight, np.zeros(3)).stability == pytest.approx(1.0, abs=1e-12)


def test_opposite_tubes_snap_where_the_determinant_vanishes() -> None:
    """Pushed out of the channel, opposite tubes overlap more and more until they buckle."""
    low, high = -0.3, -0.25
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if analytic(middle, -1.0) > 0.0 else (low, middle)
    fraction = first_snap(opposite(-0.299), opposite(-0.2), EQUAL_ENDS)
    assert fraction is not None
    assert -0.299 + 0.099 * fraction == pytest.approx(low, abs=1e-6)


def test_turning_a_tube_all_around_snaps_after_half_a_turn() -> None:
    at = [-387, -267, -149]
    begin, end = configuration(at, [0, 0, 0]), configuration(at, [360, 0, 0])
    fraction = first_snap(begin, end, THREE)
    assert fraction is not None
    assert 0.5 < fraction < 1.0
    # The other way round is its mirror image.
    mirrored = first_snap(begin, configuration(at, [-360, 0, 0]), THREE)
    assert mirrored == pytest.approx(fraction, abs=2e-6)
    # Just before it the branch can still be followed, at the fold it is nearly singular.
    assert first_snap(begin, begin + 0.999 * fraction * (end - begin), THREE) is None
    follower = BranchFollower(begin, THREE)
    for share in np.linspace(0.0, 0.99 * fraction, 400):
        assert follower.step(begin + share * (end - begin))
    for closer in 0.01 / 1.5 ** np.arange(1, 18):
        assert follower.step(begin + (1.0 - closer) * fraction * (end - begin))
    assert 0.0 < follower.determinant < 0.02
    stands = follower.q
    assert not follower.step(begin + (fraction + 1e-3) * (end - begin))
    assert follower.q is stands


def test_drawn_apart_the_same_turn_does_not_snap() -> None:
    at = [-100, -80, -50]
    begin, end = configuration(at, [0, 0, 0]), configuration(at, [720, -360, 90])
    assert first_snap(begin, end, THREE) is None


def test_nothing_stable_at_the_beginning() -> None:
    q = configuration([-387, -267, -149], [180, 0, 0])
    assert solve_cold(q, THREE, np.empty(3)) == SINGULAR
    assert first_snap(q, configuration([-387, -267, -149], [0, 0, 0]), THREE) == 0.0
    with pytest.raises(TubesSnap, match=r"turned to 180, 0, 0 degrees .*draw one back") as refusal:
        BranchFollower(q, THREE)
    np.testing.assert_array_equal(refusal.value.q, q)


def test_paths_that_leave_the_bounds_are_refused() -> None:
    inside = configuration([-100, -80, -50], [0, 0, 0])
    outside = configuration([-100, -120, -50], [0, 0, 0])
    with pytest.raises(TubeOutOfBounds):
        first_snap(inside, outside, THREE)
    with pytest.raises(TubeOutOfBounds):
        BranchFollower(outside, THREE)
    with pytest.raises(InvalidTubeConfiguration):
        first_snap(inside[:4], inside, THREE)
