"""Order and delay of samples, by their stamps."""

from __future__ import annotations

import numpy as np
import pytest

from server.leaders.stamps import Order, StampOrder

MS = 1_000_000
WALL_CLOCK = 1_790_000_000_000_000_000


@pytest.mark.parametrize("device_clock", [0, 5 * MS, WALL_CLOCK, -3])
def test_samples_in_order_are_new_whatever_the_clock(device_clock: int) -> None:
    order = StampOrder()
    for step in range(1, 1000):
        assert order.take(device_clock + 2 * MS * step, 2 * MS * step) is Order.NEW
        assert order.delay_ns == 0


def test_without_stamps_everything_is_new() -> None:
    order = StampOrder()
    for step in range(1, 10):
        assert order.take(0, step) is Order.NEW
        assert order.delay_ns == 0


def test_a_stamp_that_comes_again_or_goes_back_is_seen() -> None:
    order = StampOrder()
    assert order.take(10 * MS, MS) is Order.NEW
    assert order.take(10 * MS, 3 * MS) is Order.REPEATED
    assert order.take(8 * MS, 5 * MS) is Order.OUT_OF_ORDER
    assert order.take(12 * MS, 7 * MS) is Order.NEW


def test_a_frozen_stamp_never_becomes_new() -> None:
    order = StampOrder()
    order.take(10 * MS, 0)
    assert {order.take(10 * MS, step * 2 * MS) for step in range(1000)} == {Order.REPEATED}


def test_a_clock_that_was_set_back_is_taken_after_half_a_second() -> None:
    order = StampOrder()
    for step in range(1, 100):
        order.take(WALL_CLOCK + step * 2 * MS, step * 2 * MS)
    back, now = WALL_CLOCK - 10**10, 200 * MS
    seen = [order.take(back + step * 2 * MS, now + step * 2 * MS) for step in range(400)]
    reset = seen.index(Order.RESET)
    assert set(seen[:reset]) == {Order.OUT_OF_ORDER}
    assert set(seen[reset + 1 :]) == {Order.NEW}
    assert 0.4e9 < reset * 2 * MS < 0.6e9


def test_delay_is_counted_above_the_quickest(rng: np.random.Generator) -> None:
    order = StampOrder()
    for step in range(1, 2000):
        way = round(float(rng.uniform(1.0, 4.0)) * MS)
        order.take(WALL_CLOCK + 8 * step * MS, 8 * step * MS + way)
        assert 0 <= order.delay_ns <= 3 * MS
    order.take(WALL_CLOCK + 8 * 2000 * MS, 8 * 2000 * MS + 101 * MS)
    assert 97 * MS <= order.delay_ns <= 100 * MS


def test_a_drifting_clock_is_no_delay() -> None:
    order = StampOrder()
    worst = 0
    for step in range(1, 50_000):
        # 100 millionths faster than ours
        order.take(WALL_CLOCK + step * 2 * MS, round(step * 2 * MS * 1.0001))
        worst = max(worst, order.delay_ns)
    assert worst < 2 * MS
