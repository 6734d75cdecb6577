"""Where the tip was asked to go and where it went, over the last seconds."""

from __future__ import annotations

from collections import deque

import numpy as np
import viser
from numpy.typing import NDArray

from server.scene_palette import DESIRED, TRUE, Colour

SECONDS = 20.0
SAMPLES_PER_SECOND = 10.0
MOST_POINTS = int(SECONDS * SAMPLES_PER_SECOND)
SMALLEST_STEP = 1e-4
"""Steps shorter than this (m) make no new point."""
LARGEST_STEP = 0.02
"""Steps longer than this (m) are jumps: nothing is drawn between their ends."""
EXPIRY_PERIOD = 0.5


class Trail:
    """One polyline of bounded length and age."""

    def __init__(
        self, server: viser.ViserServer, name: str, colour: Colour, thickness: float
    ) -> None:
        """Build an empty trail.

        Args:
            server: draws.
            name: scene node.
            colour: sRGB.
            thickness: px.
        """
        self._points: deque[tuple[float, NDArray[np.float64]]] = deque(maxlen=MOST_POINTS)
        self._expired = 0.0
        self._changed = False
        self.line = server.scene.add_line_segments(
            name, np.zeros((1, 2, 3)), colour, thickness=thickness, thickness_units="screen"
        )

    def record(self, now: float, point: NDArray[np.float64]) -> None:
        """Take in where the tip is; ``now`` in s, ``point`` (3,) in m."""
        if not self._points or np.linalg.norm(point - self._points[-1][1]) > SMALLEST_STEP:
            self._points.append((now, point.copy()))
            self._changed = True
        if now - self._expired > EXPIRY_PERIOD:
            self._expired = now
            while len(self._points) > 1 and now - self._points[0][0] > SECONDS:
                self._points.popleft()
                self._changed = True

    def draw(self) -> None:
        """Send the trail if it changed."""
        if not self._changed:
            return
        self._changed = False
        points = np.array([point for _, point in self._points], dtype=np.float32)
        pieces = np.stack([points[:-1], points[1:]], axis=1)
        pieces = pieces[np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1) < LARGEST_STEP]
        self.line.points = pieces if len(pieces) else np.repeat(points[None, -1:], 2, axis=1)


class SceneTrails:
    """``/trail/desired`` and ``/trail/true``."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Build both, empty."""
        self._root = server.scene.add_frame("/trail", show_axes=False)
        self.desired = Trail(server, "/trail/desired", DESIRED, 4.0)
        self.true = Trail(server, "/trail/true", TRUE, 2.0)
        self._recorded = 0.0

    @property
    def visible(self) -> bool:
        """Whether the trails are shown."""
        return bool(self._root.visible)

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._root.visible = visible

    def update(
        self,
        now: float,
        desired: NDArray[np.float64],
        true: NDArray[np.float64],
        *,
        draw: bool,
    ) -> None:
        """Sample at ten a second, and send what changed.

        Args:
            now: s.
            desired: (3,) desired tip, m.
            true: (3,) true tip, m.
            draw: send; otherwise only remember.
        """
        if now - self._recorded < 1.0 / SAMPLES_PER_SECOND:
            return
        self._recorded = now
        for trail, point in ((self.desired, desired), (self.true, true)):
            trail.record(now, point)
            if draw:
                trail.draw()
