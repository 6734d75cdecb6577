"""Goals: followed at a limited speed, held when old, let go only from where the servos are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.module.errors import NoRoom
from hardware.module.following import STALE_NS, Follower
from hardware.module.transmission import Transmission
from server.configuration_file import load

CONFIGURATION = load()
SPEED = math.radians(60.0)
DT_S = 0.004


def _follower() -> Follower:
    follower = Follower(Transmission(CONFIGURATION), SPEED)
    follower.take([2048] * 4)
    follower.hold([2048] * 4, [0] * 4)
    return follower


def _rested() -> Follower:
    follower = _follower()
    follower.follow((0.0,) * 4, False, 0, DT_S)
    return follower


def test_goals_move_no_faster_than_they_may() -> None:
    follower = _rested()
    largest = SPEED * DT_S * 4096 / (2 * math.pi) + 1.0
    follower.follow((0.0,) * 4, True, 0, DT_S)
    before = list(follower.goals)
    for _ in range(1000):
        follower.follow((1.0, -1.0, 0.0, 0.2), True, 0, DT_S)
        steps = [abs(a - b) for a, b in zip(follower.goals, before, strict=True)]
        assert max(steps) <= largest
        before = list(follower.goals)
    assert before == [round(2048 + angle * 2048 / math.pi) for angle in (1.0, -1.0, 0.0, 0.2)]


def test_after_a_hold_a_motion_must_follow_a_rest_and_begin_here() -> None:
    follower = _follower()
    follower.follow((0.01,) * 4, True, 0, DT_S)
    assert follower.goals == [2048] * 4, "no rest yet"
    follower.follow((0.5,) * 4, False, 0, DT_S)
    follower.follow((0.5,) * 4, True, 0, DT_S)
    assert follower.goals == [2048] * 4, "too far from here"
    follower.follow((0.01,) * 4, True, 0, DT_S)
    assert follower.goals != [2048] * 4


def test_an_old_command_is_not_followed_any_further() -> None:
    follower = _rested()
    follower.follow((0.02,) * 4, True, 0, DT_S)
    goals = list(follower.goals)
    follower.follow((0.02,) * 4, True, STALE_NS + 1, DT_S)
    assert follower.stale
    assert follower.goals == goals


def test_a_hold_keeps_the_load_and_drops_a_goal_that_is_far() -> None:
    follower = _follower()
    # 10 % of load are 17.7 ticks at the servo's usual gain.
    follower.hold([2060, 2148, 2036, 1948], [0, 0, 100, -100])
    assert follower.goals == [2048, 2148, 2048, 1930]


def test_angles_are_cut_to_the_range() -> None:
    transmission = Transmission(CONFIGURATION)
    ticks = [0.0] * 4
    transmission.ticks((9.0, -9.0, 0.0, 0.0), ticks)
    assert ticks == [2048 + transmission.half_range, 2048 - transmission.half_range, 2048, 2048]


@pytest.mark.parametrize("directions", [(1, 1, 1, 1), (1, -1, -1, 1)])
def test_ticks_and_angles_are_inverse(directions: tuple[int, ...]) -> None:
    servos = CONFIGURATION.servos.model_copy(update={"directions": directions})
    transmission = Transmission(CONFIGURATION.model_copy(update={"servos": servos}))
    transmission.set_zero([1900, 2000, 2100, 2200])
    angles = (0.3, -0.2, 0.0, 1.1)
    ticks, back = [0.0] * 4, np.zeros(4)
    transmission.ticks(angles, ticks)
    transmission.angles(ticks, back)
    np.testing.assert_allclose(back, angles, atol=1e-12)
    # Negative angles pull: the tendon becomes shorter by pulley radius times angle.
    radius = CONFIGURATION.module.pulley_radius_m
    np.testing.assert_allclose(transmission.pulled_m(ticks), -radius * np.array(angles))


def test_a_zero_near_an_end_of_the_turn_is_refused() -> None:
    transmission = Transmission(CONFIGURATION)
    with pytest.raises(NoRoom, match="servo 103: straight is at tick 4000"):
        transmission.set_zero([2048, 2048, 4000, 2048])
    assert transmission.zero == [2048] * 4
