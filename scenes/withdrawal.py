"""Safe withdrawal: straighten the segment where it is, then draw the shaft out along its axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.rotations import quaternion_from_matrix
from robot.segment import tip_position, tip_rotation

SPEED_M_S = 0.03
"""Largest speed of the tip, m/s."""
ANGULAR_SPEED_RAD_S = math.radians(30.0)
"""Largest speed of the bend, rad/s."""
LAMBDA_SPARE = 0.001
"""The shaft is drawn out to this much below the limit of lambda, so that the limit, where every
motion slows down, is never met."""

_SAMPLES_PER_SECOND = 100
_LEAST_S = 0.5
_PEAK = 1.875
"""Largest speed of a minimum-jerk motion over its mean speed."""


@dataclass(frozen=True)
class Withdrawal:
    """From where the instrument is withdrawn, as the controller commands it.

    Attributes:
        shaft_rotation: (3, 3) the segment's base frame in the base frame; z along the shaft.
        uv: bend (u, v), rad.
        lambda_along_shaft: where the trocar touches the shaft.
        shaft_length_m: of the rigid shaft.
        segment_length_m: of the segment.
        lambda_max: the limit of lambda.
    """

    shaft_rotation: np.ndarray
    uv: tuple[float, float]
    lambda_along_shaft: float
    shaft_length_m: float
    segment_length_m: float
    lambda_max: float

    @property
    def retraction_m(self) -> float:
        """How far the shaft is drawn out, m: as far as the limit of lambda allows."""
        left = self.lambda_max - LAMBDA_SPARE - self.lambda_along_shaft
        return max(0.0, left * self.shaft_length_m)

    @property
    def straightening_s(self) -> float:
        """How long the segment takes to become straight, s."""
        return _duration(math.hypot(*self.uv), ANGULAR_SPEED_RAD_S)

    def samples(self) -> np.ndarray:
        """The path, relative to the present tip.

        While the segment becomes straight the shaft stands still; then the tip goes straight out
        with its orientation kept. Both go from rest to rest with least jerk.

        Returns:
            (n, 8) rows of time_s, x_m, y_m, z_m, qw, qx, qy, qz as :class:`scenes.path.Path` takes
            them.
        """
        first, second = self.straightening_s, _duration(self.retraction_m, SPEED_M_S)
        count = max(2, math.ceil((first + second) * _SAMPLES_PER_SECOND) + 1)
        rows = np.zeros((count, 8))
        rows[:, 0] = np.linspace(0.0, max(first + second, _LEAST_S), count)
        start, start_rotation = self._tip(1.0)
        outward = -self.shaft_rotation[:, 2]
        for row in rows:
            bent = 1.0 - _smooth(row[0], first)
            position, rotation = self._tip(bent)
            drawn = self.retraction_m * _smooth(row[0] - first, second)
            row[1:4] = position - start + drawn * outward
            quaternion_from_matrix(rotation @ start_rotation.T, row[4:8])
        return rows

    def _tip(self, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Tip position from the shaft's end and rotation, base frame, at a share of the bend."""
        position, rotation = np.empty(3), np.empty((3, 3))
        u, v = share * self.uv[0], share * self.uv[1]
        tip_position(u, v, self.segment_length_m, position)
        tip_rotation(u, v, rotation)
        return self.shaft_rotation @ position, self.shaft_rotation @ rotation


def _duration(way: float, speed: float) -> float:
    """Length of a minimum-jerk motion over ``way`` whose fastest moment has ``speed``."""
    return 0.0 if way < 1e-9 else max(_LEAST_S, _PEAK * way / speed)


def _smooth(time_s: float, duration_s: float) -> float:
    """Share of the way of a minimum-jerk motion, from 0 to 1."""
    if duration_s <= 0.0:
        return 1.0
    share = min(max(time_s / duration_s, 0.0), 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
