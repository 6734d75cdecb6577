"""The first part of a homing: tendons under load are let out until they bear none."""

from __future__ import annotations

import math

import pytest

from hardware.module.errors import NeverLoose, WrongDirection
from hardware.module.homing import Homing
from hardware.module.transmission import Transmission
from server.configuration_file import load

CONFIGURATION = load()
TICKS_PER_DEG = CONFIGURATION.module.servo_ticks_per_turn / 360.0
UNITS_PER_PERCENT = 10
DT_S = 0.02


def let_out(over_deg: list[float], percent_per_deg: list[float]) -> Homing:
    """Home servos whose tendons are wound up too far by ``over_deg``, until all are loose.

    Each bears ``percent_per_deg`` of its servo's largest load for every degree that it is too far;
    where that is negative the servo is mounted the other way round, and winds up further.
    """
    transmission = Transmission(CONFIGURATION)
    homing = Homing(transmission, CONFIGURATION.servos, DT_S)
    begin = [2048] * 4
    position = list(begin)
    for _ in range(5000):
        load_now = []
        for index, direction in enumerate(transmission.directions):
            out_deg = direction * (position[index] - begin[index]) / TICKS_PER_DEG
            rate = percent_per_deg[index]
            percent = abs(rate) * max(0.0, over_deg[index] - math.copysign(out_deg, rate * out_deg))
            load_now.append(round(-direction * UNITS_PER_PERCENT * percent))
        homing.step(position, load_now)
        if homing.progress >= 0.1:
            return homing
        position = [round(goal) for goal in homing.goals]
    raise AssertionError("it neither ends nor gives up")


def test_a_tendon_wound_up_far_is_let_out_as_long_as_its_load_falls() -> None:
    homing = let_out([0.0, 110.0, 0.0, 70.0], [0.25] * 4)
    assert math.isclose(homing.progress, 0.1)


def test_a_tendon_that_stays_under_load_is_refused_by_name() -> None:
    with pytest.raises(NeverLoose, match="102: still under load after 150 deg"):
        let_out([0.0, 1000.0, 0.0, 0.0], [0.02] * 4)


def test_a_load_that_grows_while_it_is_let_out_tells_the_wrong_direction() -> None:
    with pytest.raises(WrongDirection):
        let_out([0.0, 110.0, 0.0, 0.0], [0.0, -0.25, 0.0, 0.0])
