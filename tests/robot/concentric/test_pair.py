"""Two arms: where their tips stand to each other, and how that changes."""

from __future__ import annotations

import numpy as np

from robot.concentric.kinematics import OUTSIDE, SOLVED
from robot.concentric.pair import PairKinematics
from tests.robot.concentric.pair_problem import at, configurations, design, pair


def test_tips_stand_where_the_paper_s_figures_show_them() -> None:
    """Before the channels' offset, curvature about x: mm."""
    expected = (
        ((46.12, -46.12, 323.83), (46.12, -46.12, 343.83)),
        ((32.95, -7.10, 281.63), (34.90, -9.78, 302.68)),
        ((0.0, -45.48, 176.83), (0.0, -45.48, 176.83)),
    )
    for q, tips in zip(configurations(), expected, strict=False):
        found = at(q).position - pair().channels
        np.testing.assert_allclose(1e3 * found, tips, rtol=0, atol=6e-3)


def test_the_relative_position_points_from_a_to_b() -> None:
    for q in configurations():
        now = at(q)
        np.testing.assert_array_equal(now.relative, now.position[1] - now.position[0])
    np.testing.assert_allclose(at(configurations()[2]).relative, [0.012, 0.0, 0.0], atol=1e-12)


def test_relative_and_tracking_jacobians_are_derivatives() -> None:
    step = 1e-6
    for q in configurations()[:8]:
        now, moved = at(q), PairKinematics(pair().count)
        for column in range(len(q)):
            tips, relatives = [], []
            for sign in (1.0, -1.0):
                moved.q[:] = q
                moved.q[column] += sign * step
                assert pair().evaluate(moved, now.torsion) == SOLVED
                tips.append(moved.position[0].copy())
                relatives.append(moved.relative.copy())
            slope = (relatives[0] - relatives[1]) / (2.0 * step)
            np.testing.assert_allclose(now.relative_jacobian[:, column], slope, atol=1e-7)
            slope = (tips[0] - tips[1]) / (2.0 * step)
            np.testing.assert_allclose(now.tracking_jacobian[:, column], slope, atol=1e-7)


def test_from_its_own_torsion_a_configuration_evaluates_to_the_same_bits() -> None:
    for q in configurations():
        now, again = at(q), PairKinematics(pair().count)
        again.q[:] = q
        assert pair().evaluate(again, now.torsion) == SOLVED
        for name, value in vars(now).items():
            assert getattr(again, name).tobytes() == value.tobytes(), name


def test_the_torsion_ahead_is_met_to_second_order(rng: np.random.Generator) -> None:
    for q in configurations()[3:]:
        now, ahead = at(q), PairKinematics(pair().count)
        change = rng.normal(size=len(q)) * np.tile([1e-3] * 3 + [0.2] * 3, 2)
        missed = []
        for share in (1e-2, 1e-3):
            ahead.q[:] = q + share * change
            guess = np.empty(2 * pair().count)
            pair().guess_after(now, ahead.q, guess)
            assert pair().evaluate(ahead, guess) == SOLVED
            missed.append(np.abs(guess - ahead.torsion).max())
        assert missed[1] < 0.03 * missed[0] + 1e-8


def test_taking_over_is_a_copy() -> None:
    first, second = (at(q) for q in configurations()[:2])
    second.take(first)
    before = first.position.copy()
    second.position[:] = 0.0
    np.testing.assert_array_equal(first.position, before)


def test_tubes_out_of_order_are_reported_not_raised() -> None:
    q = configurations()[0].copy()
    q[1] = q[0] + 0.13  # tube 2 ends 10 mm beyond tube 1
    moved = PairKinematics(pair().count)
    moved.q[:] = q
    assert pair().evaluate(moved, moved.torsion.copy()) == OUTSIDE
    assert pair().evaluate_cold(moved) == OUTSIDE


def test_the_channels_stand_apart_as_configured() -> None:
    apart = pair().channels[1] - pair().channels[0]
    np.testing.assert_allclose(1e3 * apart, [design().channel_spacing_mm, 0.0, 0.0])
