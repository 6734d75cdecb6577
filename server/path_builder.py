"""Turning a path's samples into a spline without holding up the control loop."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections import deque
from typing import NamedTuple

from scenes.path import Path
from server.control_link import PathStart


class BuiltPath(NamedTuple):
    """A path that can be played, and its number; no path where the samples make none."""

    path: Path | None
    path_id: int


class PathBuilder:
    """Builds paths in a thread of its own, since 100,000 samples take longer than a tick.

    Make it before the calling thread becomes a real-time thread.

    Attributes:
        is_waiting: whether a path was ordered that is neither taken nor cancelled.
    """

    def __init__(self) -> None:
        self._orders: queue.SimpleQueue[tuple[int, PathStart]] = queue.SimpleQueue()
        self._built: deque[tuple[int, BuiltPath]] = deque()
        self._order = 0
        self.is_waiting = False
        threading.Thread(target=self._work, name="path builder", daemon=True).start()

    def start(self, wanted: PathStart) -> None:
        """Order a path; one ordered before and not taken yet is forgotten."""
        self._order += 1
        self.is_waiting = True
        self._orders.put((self._order, wanted))

    def cancel(self) -> None:
        """Forget what was ordered."""
        self._order += 1
        self.is_waiting = False

    def take(self) -> BuiltPath | None:
        """The path ordered last, once, when it is ready. Never waits."""
        while self._built:
            order, built = self._built.popleft()
            if order == self._order:
                self.is_waiting = False
                return built
        return None

    def _work(self) -> None:
        while True:
            order, wanted = self._orders.get()
            if order != self._order:
                continue
            path = None
            with contextlib.suppress(ValueError):
                # The link lets only whole paths in; a damaged file must not end the loop.
                path = Path(wanted.samples, f"path {wanted.path_id}")
            self._built.append((order, BuiltPath(path, wanted.path_id)))
