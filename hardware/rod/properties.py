"""What the rod is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from robot.errors import ConfigurationError


@dataclass(frozen=True)
class RodProperties:
    """A straight elastic backbone that neither stretches nor shears, and its four tendons.

    Attributes:
        length_m: length of the backbone.
        pitch_radius_m: distance of each tendon from the backbone.
        bending_stiffness_n_m2: EI, the same in every direction.
        torsion_stiffness_n_m2: GJ.
        friction: coefficient of the tendons in their disks.
        stick_m: travel of a tendon at its base that takes its friction from none to full.

    Raises:
        ConfigurationError: a value is not finite or outside what makes a rod.
    """

    length_m: float = 0.030
    pitch_radius_m: float = 0.0018
    bending_stiffness_n_m2: float = 1.841e-4
    torsion_stiffness_n_m2: float = 1.841e-4 / 1.3
    friction: float = 0.15
    stick_m: float = 20e-6

    def __post_init__(self) -> None:
        """Refuse what is no rod."""
        for field in fields(self):
            value = getattr(self, field.name)
            least = "0 or more" if field.name == "friction" else "more than 0"
            if not math.isfinite(value) or value < 0.0 or (value == 0.0 and least != "0 or more"):
                raise ConfigurationError("rod", field.name, value, least)

    def constants(self) -> np.ndarray:
        """(5,) EI (N m^2), GJ (N m^2), pitch radius (m), friction, length (m)."""
        return np.array(
            [
                self.bending_stiffness_n_m2,
                self.torsion_stiffness_n_m2,
                self.pitch_radius_m,
                self.friction,
                self.length_m,
            ]
        )
