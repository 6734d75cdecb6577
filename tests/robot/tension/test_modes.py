"""Which tendons may hold tensions: modes that hold nothing are refused."""

from __future__ import annotations

import numpy as np
import pytest

from robot.tension.modes import UncontrolledPosition, check_modes, uncommanded_co_contraction
from robot.tension.records import TendonMode
from robot.tension.stiffness import chord_curvatures, joint_stiffness
from robot.tension.structures import four_tendons, three_tendons

T, P = TendonMode.TENSION, TendonMode.POSITION
FOUR = four_tendons(1.8e-3)
STIFFNESS = np.full(4, 7554.0)
BACKBONE = 1.841e-4 / 0.03 * np.eye(2)


def test_nothing_holds_joints_that_are_all_in_tension() -> None:
    with pytest.raises(UncontrolledPosition, match="nothing holds") as caught:
        check_modes(FOUR, (T, T, T, T), STIFFNESS)
    assert caught.value.modes == (T, T, T, T)
    assert caught.value.code == "uncontrolled_position"
    # A tendon of each pair holds them; two of one pair leave the other direction free.
    check_modes(FOUR, (P, P, T, T), STIFFNESS)
    with pytest.raises(UncontrolledPosition, match="nothing holds v") as caught:
        check_modes(FOUR, (P, T, P, T), STIFFNESS)
    np.testing.assert_allclose(np.abs(caught.value.direction), [0.0, 1.0], atol=1e-12)


def test_an_elastic_backbone_holds_itself_until_tension_buckles_it() -> None:
    curvatures = chord_curvatures(FOUR, 0.03 / 800.0)

    def elastic(level: float) -> np.ndarray:
        return joint_stiffness(FOUR, np.full(4, level), np.zeros(4), curvatures, BACKBONE)

    buckling = BACKBONE[0, 0] / (8.0 * 0.03 / 800.0)
    check_modes(FOUR, (T, T, T, T), STIFFNESS, elastic(0.99 * buckling))
    with pytest.raises(UncontrolledPosition):
        check_modes(FOUR, (T, T, T, T), STIFFNESS, elastic(1.01 * buckling))
    check_modes(FOUR, (P, P, T, T), STIFFNESS, elastic(1.01 * buckling))


@pytest.mark.parametrize(
    ("modes", "left"),
    [((T, T, T, T), 0), ((P, P, T, T), 0), ((P, T, P, T), 1), ((P, P, P, T), 1), ((P,) * 4, 2)],
)
def test_co_contraction_that_nothing_sets(modes: tuple[TendonMode, ...], left: int) -> None:
    assert uncommanded_co_contraction(FOUR, modes) == left


def test_of_three_tendons_one_sets_the_co_contraction() -> None:
    three = three_tendons(1.8e-3)
    check_modes(three, (P, P, T), STIFFNESS[:3])
    assert uncommanded_co_contraction(three, (P, P, T)) == 0
    assert uncommanded_co_contraction(three, (P, P, P)) == 1
