"""Turning a path's samples into a spline without holding up the control loop."""

from __future__ import annotations

import queue
import threading
from collections import deque
from typing import NamedTuple

from scenes.path import Path
from server.control_link import PathStart


class BuiltPath(NamedTuple):
    """A path that can be played, and its number."""

    path: Path
    path_id: int


class PathBuilder:
    """Builds paths in a thread of its own, since 100,000 samples take longer than a tick.

    Make it before the calling thread becomes a real-time thread.
    """

    def __init__(self) -> None:
        self._orders: queue.SimpleQueue[tuple[int, PathStart]] = queue.SimpleQueue()
        self._built: deque[tuple[int, BuiltPath]] = deque()
        self._order = 0
        threading.Thread(target=self._work, name="path builder", daemon=True).start()

    def start(self, wanted: PathStart) -> None:
        """Order a path; one ordered before and not taken yet is forgotten."""
        self._order += 1
        self._orders.put((self._order, wanted))

    def cancel(self) -> None:
        """Forget what was ordered."""
        self._order += 1

    def take(self) -> BuiltPath | None:
        """The path ordered last, once, when it is ready. Never waits."""
        while self._built:
            order, built = self._built.popleft()
            if order == self._order:
                return built
        return None

    def _work(self) -> None:
        while True:
            order, wanted = self._orders.get()
            if order != self._order:
                continue
            try:
                path = Path(wanted.samples, f"path {wanted.path_id}")
            except ValueError:
                # The link lets only whole paths in; a damaged file must not end the loop.
                continue
            self._built.append((order, BuiltPath(path, wanted.path_id)))
