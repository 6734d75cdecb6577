"""Where the tip was asked to go and where it went, over the last seconds.

Where the two lie on each other they are drawn as alternating dashes: each stays visible, and no two
lines compete for the same pixels.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

from server.scene.palette import DESIRED, TRUE

ROOT = "/trail"
SECONDS = 20.0
SAMPLE_PERIOD = 0.1
MOST_POINTS = round(SECONDS / SAMPLE_PERIOD)
SMALLEST_STEP = 2e-4
"""Steps shorter than this (m) make no new point."""
LARGEST_STEP = 0.02
"""Steps longer than this (m) are jumps: nothing is drawn between their ends."""
TOGETHER = 4e-4
"""Nearer than this (m), desired and true are drawn as dashes."""
DASH = 0.004
EXPIRY_PERIOD = 0.5
THICKNESS = 2.5


class Sample(NamedTuple):
    """Time (s), distance travelled so far (m), desired and true tip (3,), m."""

    time: float
    travelled: float
    desired: NDArray[np.float64]
    true: NDArray[np.float64]


class SceneTrails:
    """``/trail/desired`` and ``/trail/true``."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Build both, empty."""
        self._root = server.scene.add_frame(ROOT, show_axes=False)
        self._samples: deque[Sample] = deque(maxlen=MOST_POINTS)
        self._sampled = self._expired = -np.inf
        self._changed = False
        self.desired, self.true = (
            server.scene.add_line_segments(
                f"{ROOT}/{name}",
                np.zeros((1, 2, 3)),
                colour,
                thickness=THICKNESS,
                thickness_units="screen",
            )
            for name, colour in (("desired", DESIRED), ("true", TRUE))
        )

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
        """Sample at most ten times a second, and send what changed.

        Args:
            now: s.
            desired: (3,) desired tip, m.
            true: (3,) true tip, m.
            draw: send; otherwise only remember.
        """
        if now - self._sampled < SAMPLE_PERIOD:
            return
        self._sampled = now
        self._remember(now, desired, true)
        if draw and self._changed and self._root.visible:
            self._changed = False
            self._draw()

    def _remember(
        self, now: float, desired: NDArray[np.float64], true: NDArray[np.float64]
    ) -> None:
        travelled, step = 0.0, np.inf
        if self._samples:
            last = self._samples[-1]
            step = float(np.linalg.norm(true - last.true))
            travelled = last.travelled + step
            step = max(step, float(np.linalg.norm(desired - last.desired)))
        if step > SMALLEST_STEP:
            self._samples.append(Sample(now, travelled, desired.copy(), true.copy()))
            self._changed = True
        if now - self._expired > EXPIRY_PERIOD:
            self._expired = now
            while len(self._samples) > 1 and now - self._samples[0].time > SECONDS:
                self._samples.popleft()
                self._changed = True

    def _draw(self) -> None:
        desired = np.array([sample.desired for sample in self._samples])
        true = np.array([sample.true for sample in self._samples])
        apart = np.linalg.norm(desired - true, axis=1)[1:] > TOGETHER
        dash = np.array([sample.travelled // DASH for sample in self._samples])[1:] % 2 == 0
        self.desired.points = _pieces(desired, apart | dash)
        self.true.points = _pieces(true, apart | ~dash)


def _pieces(points: NDArray[np.float64], shown: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Line pieces (n, 2, 3) between neighbours; one of no length if there are none."""
    steps = np.linalg.norm(points[1:] - points[:-1], axis=1)
    pairs = np.stack([points[:-1], points[1:]], axis=1)
    pieces: NDArray[np.float32] = pairs[shown & (steps < LARGEST_STEP)].astype(np.float32)
    if not len(pieces):
        pieces = np.repeat(points[None, -1:], 2, axis=1).astype(np.float32)
    return pieces
