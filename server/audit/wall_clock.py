"""Notices that the wall clock was set, or that the computer slept. Nothing depends on it."""

from __future__ import annotations

import time
from collections.abc import Callable

LARGEST_DRIFT_S = 0.5
"""Between two looks; a clock that is slewed stays far below."""


class WallClock:
    """Compares the wall clock with the monotonic one.

    Args:
        wall: seconds of the wall clock.
        steady: seconds of the monotonic clock.
    """

    def __init__(
        self,
        wall: Callable[[], float] = time.time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._wall, self._steady = wall, steady
        self._ahead = wall() - steady()

    def jump_s(self) -> float | None:
        """By how much it has jumped since the last look, None where it has not."""
        ahead = self._wall() - self._steady()
        jump, self._ahead = ahead - self._ahead, ahead
        return jump if abs(jump) > LARGEST_DRIFT_S else None
