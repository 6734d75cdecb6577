"""The proximal constraint: rows that couple neighbours, and the paper's boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.concentric.proximal import (
    Proximal,
    box_of_eq7,
    braking_rate,
    excess,
    gap_rates,
    moving_bounds,
    settle_inside,
)
from robot.concentric.tubes import MeaninglessTubes
from tests.robot.concentric.pair_problem import configurations, design


@pytest.fixture
def limits() -> Proximal:
    return Proximal(design())


def bounds_of(limits: Proximal) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return limits.lower, limits.upper, limits.gap_lower, limits.gap_upper


def random_inside(limits: Proximal, rng: np.random.Generator) -> np.ndarray:
    """Translations anywhere inside of (1), the limits themselves included now and then."""
    beta = np.empty(3)
    beta[2] = rng.uniform(limits.lower[2], limits.upper[2])
    for n in (1, 0):
        share = rng.choice([0.0, 1.0, rng.uniform()])
        gap = limits.gap_lower[n] + share * (limits.gap_upper[n] - limits.gap_lower[n])
        beta[n] = beta[n + 1] - gap
    return beta


def test_the_bounds_are_those_of_the_paper_s_tubes(limits: Proximal) -> None:
    np.testing.assert_allclose(1e3 * limits.gap_lower, [1.0, 1.0])
    np.testing.assert_allclose(1e3 * limits.gap_upper, [119.0, 117.0])
    np.testing.assert_allclose(1e3 * limits.lower, [-434.0, -315.0, -198.0])
    np.testing.assert_allclose(1e3 * limits.upper, [-2.0, -1.0, 0.0])


def test_eq_1_with_margins_holds_wherever_the_rows_hold(
    limits: Proximal, rng: np.random.Generator
) -> None:
    length = limits.lengths
    for _ in range(200):
        beta = random_inside(limits, rng)
        assert excess(beta, *bounds_of(limits)) < 1e-12
        tips = beta + length
        assert np.all(np.diff(beta) >= 0.001 - 1e-12)
        assert np.all(np.diff(tips) <= -0.001 + 1e-12)
        assert beta[2] <= 1e-12
        assert tips[2] >= 0.001 - 1e-12
        assert -length[0] <= beta[0] <= 0.0


def test_the_violation_is_the_largest_distance_outside(limits: Proximal) -> None:
    inside = configurations()[0][:3]
    assert limits.excess(inside) == 0.0
    for change, expected in (
        ([0.0, -0.025, 0.0], 0.006),  # tube 2 is 20 mm from tube 1 and must stay 1 mm away
        ([0.0, 0.0, 0.06], 0.01),
        ([0.0, 0.0, 0.048], 0.0),
    ):
        assert limits.excess(inside + change) == pytest.approx(expected, abs=1e-12)


def test_moving_bounds_follow_the_tube_inside(limits: Proximal) -> None:
    beta, least, largest = configurations()[0][:3], np.empty(3), np.empty(3)
    moving_bounds(beta, *bounds_of(limits), least, largest)
    np.testing.assert_allclose(1e3 * least, [-434.0, -99.0, -79.0])
    np.testing.assert_allclose(1e3 * largest, [-2.0, -1.0, 0.0])
    beta = np.array([-0.25, -0.2, -0.12])
    moving_bounds(beta, *bounds_of(limits), least, largest)
    np.testing.assert_allclose(1e3 * least, [-434.0, -249.0, -198.0])
    np.testing.assert_allclose(1e3 * largest, [-2.0, -131.0, -83.0])


def test_the_box_is_eq_7_inside_and_leads_back_from_outside() -> None:
    beta = np.array([-0.1, -0.0995, -0.08, -0.1002, -0.12])
    least, largest = np.full(5, -0.1), np.full(5, -0.06)
    lower, upper = np.empty(5), np.empty(5)
    box_of_eq7(beta, least, largest, 0.1, 0.005, 0.001, lower, upper)
    np.testing.assert_allclose(lower[:2], [0.0, -math.sqrt(2.0 * 0.001 * 0.0005)])
    np.testing.assert_allclose([lower[2], upper[2]], [-0.005, 0.005])
    np.testing.assert_allclose(lower[3:], [0.002, 0.005])
    assert np.all(lower <= upper)


def test_braking_never_passes_the_limit_and_never_turns_around(rng: np.random.Generator) -> None:
    for room in [0.0, -1e-3, *rng.uniform(0.0, 0.02, 200)]:
        rate = braking_rate(room, 0.1, 0.005, 0.001)
        assert 0.0 <= rate <= 0.005
        assert rate * 0.1 <= max(room, 0.0) + 1e-15


def test_standing_still_is_always_allowed(limits: Proximal, rng: np.random.Generator) -> None:
    lower, upper = np.empty(2), np.empty(2)
    for _ in range(200):
        beta = random_inside(limits, rng)
        if rng.uniform() < 0.3:
            beta += rng.normal(size=3) * 1e-3  # even outside
        gap_rates(beta, limits.gap_lower, limits.gap_upper, 0.1, 0.005, 0.001, lower, upper)
        assert np.all(lower <= 0.0)
        assert np.all(upper >= 0.0)


def test_any_rates_inside_the_rows_stay_inside_the_bounds(
    limits: Proximal, rng: np.random.Generator
) -> None:
    lower, upper = np.empty(2), np.empty(2)
    for _ in range(300):
        beta = random_inside(limits, rng)
        gap_rates(beta, limits.gap_lower, limits.gap_upper, 0.1, 0.005, 0.001, lower, upper)
        outer = rng.uniform(-1.0, 1.0)
        room = limits.upper[2] - beta[2] if outer > 0.0 else beta[2] - limits.lower[2]
        outer *= braking_rate(room, 0.1, 0.005, 0.001)
        middle = outer - rng.choice([lower[1], upper[1], rng.uniform(lower[1], upper[1])])
        inner = middle - rng.choice([lower[0], upper[0], rng.uniform(lower[0], upper[0])])
        after = beta + 0.1 * np.array([inner, middle, outer])
        assert 1e3 * limits.excess(after) < 1e-9


def test_boxes_alone_are_overrun(limits: Proximal) -> None:
    """What the paper's methods do: the neighbour comes 0.5 mm nearer in the same step."""
    beta = np.array([-0.1, -0.099, -0.05])
    least, largest, lower, upper = (np.empty(3) for _ in range(4))
    moving_bounds(beta, *bounds_of(limits), least, largest)
    box_of_eq7(beta, least, largest, 0.1, 0.005, 0.001, lower, upper)
    after = beta + 0.1 * np.array([upper[0], 0.0, 0.0])
    assert 1e3 * limits.excess(after) == pytest.approx(0.5)


def test_settling_takes_back_the_tolerance_and_leaves_the_rest(
    limits: Proximal, rng: np.random.Generator
) -> None:
    for _ in range(200):
        inside = random_inside(limits, rng)
        settled = inside + rng.uniform(-1e-9, 1e-9, 3)
        settle_inside(settled, *bounds_of(limits))
        assert 1e3 * limits.excess(settled) < 1e-12
        np.testing.assert_allclose(settled, inside, rtol=0, atol=4e-9)


def test_margins_that_leave_no_room_are_refused() -> None:
    wide = design().limits.model_copy(update={"minimum_segment_mm": 117.5})
    with pytest.raises(MeaninglessTubes, match=r"tube 2: .* leave it -0.5 mm to move"):
        Proximal(design().model_copy(update={"limits": wide}))
