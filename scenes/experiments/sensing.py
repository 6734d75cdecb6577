"""The experiments of shape and force sensing, by name: what is pulled, bent and touched.

Paper 3, section IV. All of them are of one segment with four tendons; a pull is the tension of a
tendon above its pretension. Angles are those of the paper: the segment bends by theta and its tip
leans to (cos delta, -sin delta) in the segment's base frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robot.errors import UnknownName

CHIRP = "chirp"
PULL_RELEASE = "pull-release"
SHAPE_FREE = "shape-free"
FORCE_LEVELS = "force-levels"
COVERAGE = "coverage"

TITLES = {
    CHIRP: "one motor module follows a chirp of 0.1 to 10 Hz (Fig. 6)",
    PULL_RELEASE: "four pairs of tendons are pulled and released, free of contact (Fig. 7)",
    SHAPE_FREE: "shape of the segment bent to 45/135 and 67/-45 deg (Figs. 9, 10)",
    FORCE_LEVELS: "pressing on a platform at 48/135 deg, five levels (Figs. 11, 12)",
    COVERAGE: "how often the true force lies in the estimate's 95 % region (--trials)",
}
"""Names and what they are, for people."""

PRETENSION_N = 0.3
"""Tension of every tendon of the straight segment."""


class Bend(NamedTuple):
    """A bend of the segment.

    Attributes:
        theta_deg: by how much.
        delta_deg: whereto: the tip leans to (cos delta, -sin delta).
    """

    theta_deg: float
    delta_deg: float

    def words(self) -> str:
        """For people."""
        return f"{self.theta_deg:g}/{self.delta_deg:g} deg"

    def shares(self) -> np.ndarray:
        """(4,) how a pull toward this bend divides among the tendons; none is negative.

        Its norm is 1, so that the moment of a pull does not depend on the direction.
        """
        lean = -math.radians(self.delta_deg)
        return np.asarray(np.maximum(np.cos(0.5 * math.pi * np.arange(4) - lean), 0.0))

    def tensions(self, pull: float) -> np.ndarray:
        """(4,) tensions of a ``pull`` toward this bend, N."""
        return PRETENSION_N + pull * self.shares()


FREE_BENDS = (Bend(45.0, 135.0), Bend(67.0, -45.0))
"""Of Figs. 9 and 10."""
CONTACT_BEND = Bend(48.0, 135.0)
"""Of Fig. 11: the third of the five levels."""
TOUCHING_DEG = 40.8
"""Bend at which the tip begins to touch the platform; the third level then bends it to 48 deg."""
LEVEL_PULLS_N = (0.35, 1.1, 1.9, 2.7, 3.6)
"""Pulls of the five levels beyond the one that touches; they press with about 0.03 to 0.33 N."""
FIGURE_LEVEL = 2
"""Place among the levels of the one with the bend of Fig. 11."""
PLATFORM_STIFFNESS_N_M = 2000.0


class Pair(NamedTuple):
    """Two opposite tendons, counted from 0.

    Attributes:
        pulled: whose tension rises and falls.
        released: the other one.
        words: for people, who count from 1.
    """

    pulled: int
    released: int
    words: str


PAIRS = (
    Pair(0, 2, "pull 1, release 3"),
    Pair(1, 3, "pull 2, release 4"),
    Pair(2, 0, "pull 3, release 1"),
    Pair(3, 1, "pull 4, release 2"),
)
"""Panels of Fig. 7; its last one is captioned "release cable 1", which is not opposite to 4."""
PEAK_PULL_N = 3.5
"""Pull at which a pair turns around: about 54 deg of bend."""
STOPS = 8
"""Stops on the way up, the turning point included, and as many on the way down."""


class PullStop(NamedTuple):
    """One stop of the pull-release programme.

    Attributes:
        pair: place in ``PAIRS``.
        pulling: whether the pair is on its way up.
        tensions: (4,) N.
    """

    pair: int
    pulling: bool
    tensions: np.ndarray


def pull_release() -> list[PullStop]:
    """The programme: one pair after the other, from the straight segment up and back."""
    way = np.linspace(0.0, PEAK_PULL_N, STOPS + 1)
    found = []
    for place, pair in enumerate(PAIRS):
        for pulling, pulls in ((True, way[1:]), (False, way[-2::-1])):
            for pull in pulls:
                tensions = np.full(4, PRETENSION_N)
                tensions[pair.pulled] += pull
                found.append(PullStop(place, pulling, tensions))
    return found


def check_name(name: str) -> None:
    """Raise :class:`robot.errors.UnknownName` for an experiment that does not exist."""
    if name not in TITLES:
        raise UnknownName("sensing experiment", name, tuple(TITLES))
