"""How much of a motion the limits of the tubes' rates leave."""

from __future__ import annotations

import numpy as np

from robot.concentric.rate_limits import share_within

SPEED, TURN = 5e-3, 0.5


def limits(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bounds of boxes (12,) and gaps (4,) around zero, rotations without any."""
    lower, upper = -SPEED * rng.random(12), SPEED * rng.random(12)
    for arm in range(2):
        lower[6 * arm + 3 : 6 * arm + 6], upper[6 * arm + 3 : 6 * arm + 6] = -1e30, 1e30
    return lower, upper, -SPEED * rng.random(4), SPEED * rng.random(4)


def gaps(rates: np.ndarray) -> np.ndarray:
    return np.concatenate([np.diff(rates[:3]), np.diff(rates[6:9])])


def test_what_is_left_keeps_every_limit_and_touches_one(rng: np.random.Generator) -> None:
    slowed = 0
    for _ in range(300):
        low, high, closing, opening = limits(rng)
        rates = rng.normal(size=12) * np.tile(np.repeat([SPEED, TURN], 3), 2)
        share = share_within(rates, low, high, closing, opening, TURN)
        assert 0.0 <= share <= 1.0
        kept = share * rates
        room = [
            np.min(high - kept), np.min(kept - low), np.min(opening - gaps(kept)),
            np.min(gaps(kept) - closing), TURN - np.abs(kept.reshape(2, 2, 3)[:, 1]).max(),
        ]  # fmt: skip
        assert min(room) >= -1e-15
        if share < 1.0:
            slowed += 1
            assert min(room) < 1e-12
    assert slowed > 100


def test_at_a_limit_nothing_goes_further_and_everything_back(rng: np.random.Generator) -> None:
    low, high, closing, opening = limits(rng)
    high[0] = 0.0
    rates = np.zeros(12)
    rates[0] = 1e-4
    assert share_within(rates, low, high, closing, opening, TURN) == 0.0
    low[0] = closing[0] = -SPEED
    opening[0] = SPEED
    assert share_within(-rates, low, high, closing, opening, TURN) == 1.0
