"""The rod as sensors see it: a noisy pose of the tip, noisy tensions and tendon lengths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hardware.rod.rod import RodShape
from robot.rotations import exponential


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations of independent normal errors.

    Attributes:
        position_mm: of each coordinate of the tip.
        angle_deg: of the tip's orientation about each axis of the segment's base frame.
        tension_n: of each tension.
        length_mm: of each change of a tendon's length.
    """

    position_mm: float = 0.0
    angle_deg: float = 0.0
    tension_n: float = 0.0
    length_mm: float = 0.0


class Measurement(NamedTuple):
    """What the sensors say.

    Attributes:
        position: (3,) of the tip, segment base frame, m.
        rotation: (3, 3) of the tip.
        tensions: (4,) at the base, N.
        lengths: (4,) changes of the tendons' lengths, m.
    """

    position: np.ndarray
    rotation: np.ndarray
    tensions: np.ndarray
    lengths: np.ndarray


def measure(
    shape: RodShape, tensions: np.ndarray, noise: SensorNoise, rng: np.random.Generator
) -> Measurement:
    """Measure a shape once.

    Every measurement draws as many numbers, so that two levels of noise can be compared.

    Args:
        shape: the true one.
        tensions: (4,) true, N.
        noise: how much to disturb them.
        rng: where the errors come from.
    """
    turn = np.empty((3, 3))
    moved = noise.position_mm * 1e-3 * rng.normal(size=3)
    exponential(math.radians(noise.angle_deg) * rng.normal(size=3), turn)
    return Measurement(
        position=shape.tip_position + moved,
        rotation=turn @ shape.tip_rotation,
        tensions=tensions + noise.tension_n * rng.normal(size=4),
        lengths=shape.lengths + noise.length_mm * 1e-3 * rng.normal(size=4),
    )
