"""Where the boards stand: before the tip as it is at the configured start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.configuration import Configuration
from robot.segment import tip_position
from robot.start import start_bend, start_shaft_rotation, start_tip_rotation
from scenes.boards.solids import fixed


@dataclass(frozen=True, eq=False)
class Place:
    """The tip at the start, and the level frame in which boards are laid out.

    Attributes:
        tip: (3,) tip at the start, base frame, m.
        tip_rotation: (3, 3) its frame; z is the tip's direction.
        heading: (3, 3) x where the tip points, made level; z up.
        tip_radius: of the instrument, m.
    """

    tip: np.ndarray
    tip_rotation: np.ndarray
    heading: np.ndarray
    tip_radius: float

    @property
    def hemisphere(self) -> np.ndarray:
        """(3,) centre of the tip's rounded end, m."""
        centre: np.ndarray = self.tip - self.tip_radius * self.tip_rotation[:, 2]
        return centre

    def at(self, forward: float, left: float, up: float) -> np.ndarray:
        """The point (3,), base frame, this far (m) from the tip at the start."""
        point: np.ndarray = self.tip + self.heading @ np.array([forward, left, up])
        return point


def place(configuration: Configuration) -> Place:
    """The place of the boards for a configuration.

    A tip that points straight up or down has no heading of its own; the shaft's is taken then, and
    the base's x where that too is upright.
    """
    shaft = start_shaft_rotation(configuration)
    local = np.empty(3)
    tip_position(*start_bend(configuration), configuration.instrument.segment_length_m, local)
    beyond = 1.0 - configuration.start.lambda_along_shaft
    beyond *= configuration.instrument.shaft_length_m
    rotation = start_tip_rotation(configuration)
    heading = np.array([1.0, 0.0])
    for direction in (shaft[:2, 2], rotation[:2, 2]):
        if np.linalg.norm(direction) > 0.1:
            heading = direction / np.linalg.norm(direction)
    cosine, sine = heading
    return Place(
        tip=fixed(np.array(configuration.trocar.position_m) + beyond * shaft[:, 2] + shaft @ local),
        tip_rotation=fixed(rotation),
        heading=fixed([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]),
        tip_radius=configuration.instrument.disk_diameter_m / 2,
    )
