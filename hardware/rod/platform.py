"""A compliant platform without friction that the tip presses on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.errors import ConfigurationError


@dataclass(frozen=True)
class Platform:
    """A half-space; it pushes the tip back along its normal with stiffness times penetration.

    Attributes:
        point: a point of the surface, segment base frame, m.
        normal: out of the platform, of any length but zero.
        stiffness_n_m: force per penetration.

    Raises:
        ConfigurationError: the normal is zero, or a value is not finite or not positive.
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    stiffness_n_m: float = 2000.0

    def __post_init__(self) -> None:
        """Refuse what is no platform."""
        if not np.all(np.isfinite(self.point)):
            raise ConfigurationError("platform", "point", self.point, "three finite numbers")
        if not np.all(np.isfinite(self.normal)) or not any(self.normal):
            raise ConfigurationError("platform", "normal", self.normal, "a direction")
        if not math.isfinite(self.stiffness_n_m) or self.stiffness_n_m <= 0.0:
            value = self.stiffness_n_m
            raise ConfigurationError("platform", "stiffness_n_m", value, "finite, more than 0")

    @property
    def direction(self) -> np.ndarray:
        """(3,) unit vector out of the platform."""
        normal = np.array(self.normal, dtype=float)
        return np.asarray(normal / np.linalg.norm(normal))

    def penetration(self, position: np.ndarray) -> float:
        """How deep a place (3,) is below the surface, m; negative above it."""
        return float(self.direction @ (np.array(self.point) - position))

    def force(self, position: np.ndarray) -> np.ndarray:
        """(3,) force on a tip at this place, N."""
        return self.stiffness_n_m * max(self.penetration(position), 0.0) * self.direction
