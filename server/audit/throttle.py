"""Lets through the first of many alike, and tells how many came after it."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable


class Throttle:
    """One for each kind of thing that can come in floods. Belongs to one thread.

    Args:
        period_s: after one was let through, others alike are only counted for so long.
        most: kinds that are told apart; the longest silent one is forgotten beyond it.
        clock: monotonic clock in seconds.
    """

    def __init__(
        self, period_s: float, most: int = 256, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._period_s, self._most, self._clock = period_s, most, clock
        self._seen: dict[Hashable, tuple[float, int]] = {}

    def passes(self, kind: Hashable) -> int | None:
        """How many alike were held back before this one, or None: this one is held back too."""
        now = self._clock()
        since, held = self._seen.pop(kind, (-self._period_s, 0))
        if now - since < self._period_s:
            self._seen[kind] = (since, held + 1)
            return None
        if len(self._seen) >= self._most:
            del self._seen[next(iter(self._seen))]
        self._seen[kind] = (now, 0)
        return held
