"""The order and the delay of a device's samples, from the stamps that they bear."""

from __future__ import annotations

from collections import deque
from enum import Enum

_WINDOW_NS = 10_000_000_000
_STEP_NS = 1_000_000_000
_RESET_NS = 500_000_000


class Order(Enum):
    """How a stamp stands to the one before."""

    NEW = "new"
    REPEATED = "repeated"
    OUT_OF_ORDER = "out_of_order"
    RESET = "reset"


class StampOrder:
    """Tells new samples from old ones, and how long each was on its way beyond the shortest.

    The device's clock may be any: only differences count. Where it went back for good, its new
    time is taken after half a second in which nothing was new (``RESET``).

    Attributes:
        delay_ns: of the newest sample, above the shortest way of the last 10 s; 0 without stamps.
    """

    def __init__(self) -> None:
        self._last, self._accepted_ns = 0, 0
        self._shortest: deque[tuple[int, int]] = deque()
        self.delay_ns = 0

    def take(self, stamp_ns: int, arrived_ns: int) -> Order:
        """Judge a sample with that stamp (0 for none), in ns of the device's and of our clock."""
        order = Order.NEW
        if self._last and stamp_ns == self._last:
            return Order.REPEATED
        if self._last and stamp_ns < self._last:
            if arrived_ns - self._accepted_ns < _RESET_NS:
                return Order.OUT_OF_ORDER
            self._shortest.clear()
            order = Order.RESET
        self._last, self._accepted_ns = stamp_ns, arrived_ns
        self.delay_ns = self._delay(arrived_ns - stamp_ns, arrived_ns) if stamp_ns else 0
        return order

    def _delay(self, way_ns: int, now_ns: int) -> int:
        shortest = self._shortest
        while shortest and now_ns - shortest[0][0] > _WINDOW_NS:
            shortest.popleft()
        if shortest and now_ns - shortest[-1][0] < _STEP_NS:
            if way_ns < shortest[-1][1]:
                shortest[-1] = (shortest[-1][0], way_ns)
        else:
            shortest.append((now_ns, way_ns))
        return way_ns - min(way for _, way in shortest)
