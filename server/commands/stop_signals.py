"""The first SIGINT or SIGTERM asks for an end in order; a second one ends at once."""

from __future__ import annotations

import signal
from typing import Any


class StopSignals:
    """Turns the first SIGINT or SIGTERM into a question that can be asked; a second one ends it."""

    def __init__(self) -> None:
        self._received = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> StopSignals:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._before[number] = signal.signal(number, self._receive)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _receive(self, *_: object) -> None:
        self._received = True
        self.__exit__()

    def received(self) -> bool:
        """Whether one has come."""
        return self._received
