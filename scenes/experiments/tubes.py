"""The experiments with the two concentric-tube arms, by name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot.concentric.design import Concentric
from robot.concentric.pair import start_of
from robot.errors import UnknownName
from scenes.experiments.tube_paths import lissajous, rectangle
from scenes.experiments.tube_starts import random_starts

RANDOM = "random"
POINTS = "points"
TRADE_OFF = "trade-off"
NEAR_INFEASIBLE = "near-infeasible"

TITLES = {
    "rectangle": "A's tip on a rectangle of 30 x 20 mm, 100 points",
    "lissajous": "A's tip on a Lissajous figure of 30 x 20 mm, 100 points",
    RANDOM: "the Lissajous figure from random configurations (--count, --seed)",
    NEAR_INFEASIBLE: "the Lissajous figure, with B asked 5 mm back faster than tubes can go",
    TRADE_OFF: "rectangle and Lissajous figure: translation of the tubes against their speed",
    POINTS: "a file of points (--path FILE), offsets x_mm,y_mm,z_mm from A's first tip",
}
"""Names and what they are, for people."""


class TubeMotion(NamedTuple):
    """What A's tip and the relative position shall do.

    Attributes:
        name: of the path.
        offsets: (points, 3) of A's tip from its first position, m.
        relative_offset: by how much x_AB shall differ from that of the start, m.
    """

    name: str
    offsets: np.ndarray
    relative_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


def motions(name: str) -> tuple[TubeMotion, ...]:
    """What the experiment called ``name`` plays, in order; raises ``UnknownName``."""
    if name in ("rectangle", TRADE_OFF):
        played = (TubeMotion("rectangle", rectangle()),)
        return (*played, TubeMotion("lissajous", lissajous())) if name == TRADE_OFF else played
    if name in ("lissajous", RANDOM):
        return (TubeMotion("lissajous", lissajous()),)
    if name == NEAR_INFEASIBLE:
        return (TubeMotion(name, lissajous(), (0.0, 0.0, -0.005)),)
    raise UnknownName("concentric-tube experiment", name, tuple(TITLES))


def starts(name: str, design: Concentric, count: int, seed: int) -> dict[str, np.ndarray]:
    """Configurations q_AB (4n,), m and rad, by what they are called.

    Args:
        name: of the experiment.
        design: where the paper's configurations and the limits come from.
        count: how many random ones.
        seed: which ones.
    """
    if name == RANDOM:
        found = random_starts(design, count, seed)
        return {str(number): q for number, q in enumerate(found, 1)}
    return {str(number): start_of(start) for number, start in enumerate(design.starts, 1)}
