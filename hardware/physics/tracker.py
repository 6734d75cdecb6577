"""A simulated tracker of the tip's pose: sampled, noisy, late."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from robot.configuration import Tracker
from robot.records import TRACKER
from robot.rotations import exponential, multiply, quaternion_from_matrix


class TipTracker:
    """Samples the tip at a rate of its own; every sample comes out a fixed delay later.

    Attributes:
        newest: () ``TRACKER``: the newest sample that has come out.
    """

    def __init__(self, configuration: Tracker, generator: np.random.Generator) -> None:
        self.newest = np.zeros((), TRACKER)
        self._period_ns = round(1e9 / configuration.rate_hz)
        self._delay_ns = round(configuration.delay_ms * 1e6)
        self._position_noise_m = configuration.position_noise_mm * 1e-3
        self._angle_noise_rad = math.radians(configuration.orientation_noise_deg)
        self._generator = generator
        self._taken = 0
        self._on_the_way: deque[tuple[int, np.ndarray]] = deque()
        self._newest_ns = 0

    def look(self, time_ns: int, position: np.ndarray, rotation: np.ndarray) -> None:
        """Take a sample if it is time for one, and let out those that are due.

        Args:
            time_ns: the plant's clock.
            position: (3,) true tip, base frame, m.
            rotation: (3, 3) true tip orientation.
        """
        if time_ns >= self._taken * self._period_ns:
            self._taken += 1
            self._on_the_way.append((time_ns, self._sample(position, rotation)))
        while self._on_the_way and time_ns >= self._on_the_way[0][0] + self._delay_ns:
            self._newest_ns, self.newest = self._on_the_way.popleft()
        if self.newest["sequence"] > 0:
            self.newest["age_s"] = (time_ns - self._newest_ns) * 1e-9

    def _sample(self, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        noise = self._generator.normal(size=6)
        turn, turned = np.empty((3, 3)), np.empty((3, 3))
        exponential(self._angle_noise_rad * noise[3:], turn)
        multiply(turn, np.ascontiguousarray(rotation), turned)
        sample = np.zeros((), TRACKER)
        sample["sequence"] = self._taken
        sample["position"] = position + self._position_noise_m * noise[:3]
        quaternion_from_matrix(turned, sample["wxyz"])
        return sample
