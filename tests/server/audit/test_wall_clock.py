"""A jump of the wall clock is noticed; a slow drift is none."""

from __future__ import annotations

import pytest

from server.audit.wall_clock import WallClock


def test_only_jumps_are_told_and_each_once() -> None:
    wall, steady = [1000.0], [5.0]
    clock = WallClock(lambda: wall[0], lambda: steady[0])
    for _ in range(100):
        wall[0] += 0.26
        steady[0] += 0.25
        assert clock.jump_s() is None
    wall[0] -= 3600.0
    assert clock.jump_s() == pytest.approx(-3600.0)
    assert clock.jump_s() is None
    wall[0] += 86400.0
    assert clock.jump_s() == pytest.approx(86400.0)
