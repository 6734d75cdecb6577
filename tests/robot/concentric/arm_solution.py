"""One arm solved in one call, random configurations, and a fourth tube around the paper's three."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from robot.concentric.design import TubeDesign
from robot.concentric.kinematics import SOLVED, solve_arm, solve_cold
from robot.concentric.tubes import TUBE, tube_array

DESIGNS = tuple(
    TubeDesign(
        outer_diameter_mm=outer,
        inner_diameter_mm=inner,
        youngs_modulus_gpa=58.0,
        stiffness_ratio=1.6,
        straight_length_mm=straight,
        curved_length_mm=curved,
        curvature_per_m=curvature,
    )
    for outer, inner, straight, curved, curvature in (
        (1.524, 1.3, 387.0, 50.0, 10.0),
        (1.8, 1.62, 267.0, 50.0, 5.0),
        (2.164, 2.0, 149.0, 50.0, 7.0),
        (2.6, 2.4, 60.0, 70.0, 6.0),
    )
)
"""The paper's three tubes and a fourth around them."""

FOUR_TUBES = tube_array(DESIGNS)


class ArmSolution(NamedTuple):
    """What ``solve_arm`` fills."""

    status: int
    position: np.ndarray
    rotation: np.ndarray
    jacobian: np.ndarray
    torsion: np.ndarray
    torsion_change: np.ndarray
    stability: float


def solve(q: np.ndarray, tubes: np.ndarray, guess: np.ndarray) -> ArmSolution:
    n = len(tubes)
    outputs = np.empty(3), np.empty((3, 3)), np.empty((6, 2 * n)), np.empty(n), np.empty((n, 2 * n))
    stability = np.empty(1)
    status = solve_arm(q, guess, tubes, *outputs, stability)
    return ArmSolution(status, *outputs, float(stability[0]))


def solve_stable(q: np.ndarray, tubes: np.ndarray) -> ArmSolution:
    """Solve without a guess; must be possible."""
    torsion = np.empty(len(tubes))
    assert solve_cold(q, tubes, torsion) == SOLVED
    solution = solve(q, tubes, torsion)
    assert solution.status == SOLVED
    assert solution.stability > 0.0
    return solution


def pose_near(
    solution: ArmSolution, tubes: np.ndarray
) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """The tip's pose as a function of q on the branch of ``solution``."""

    def pose(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        near = solve(q, tubes, solution.torsion)
        assert near.status == SOLVED
        return near.position, near.rotation

    return pose


def configuration(translations_mm: Sequence[float], rotations_deg: Sequence[float]) -> np.ndarray:
    return np.concatenate([np.array(translations_mm) * 1e-3, np.radians(rotations_deg)])


def random_configuration(tubes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Inside (1) with a tenth of a millimetre to spare, any rotation."""
    spare = 1e-4
    translations = np.empty(len(tubes))
    for index, tube in enumerate(tubes):
        low, high = -tube["length"], 0.0
        if index:
            inner = translations[index - 1]
            low = max(low, inner)
            high = min(high, inner + tubes["length"][index - 1] - tube["length"])
        if high - low < 2.0 * spare:
            return random_configuration(tubes, rng)
        translations[index] = rng.uniform(low + spare, high - spare)
    return np.concatenate([translations, rng.uniform(-np.pi, np.pi, len(tubes))])


def curved_overlap(q: np.ndarray, tubes: np.ndarray) -> float:
    """Length (m) in front of the exit over which two tubes or more are curved."""
    start = np.maximum(q[: len(tubes)] + tubes["straight_length"], 0.0)
    end = np.maximum(q[: len(tubes)] + tubes["length"], 0.0)
    stops = np.unique(np.concatenate([start, end]))
    overlap = 0.0
    for low, high in pairwise(stops):
        middle = 0.5 * (low + high)
        if np.count_nonzero((start < middle) & (middle < end)) > 1:
            overlap += high - low
    return overlap


def overlapping_configuration(
    tubes: np.ndarray, rng: np.random.Generator, at_least: float = 0.01
) -> np.ndarray:
    while True:
        q = random_configuration(tubes, rng)
        if curved_overlap(q, tubes) >= at_least:
            return q


def tubes_like(tubes: np.ndarray, **values: object) -> np.ndarray:
    """A copy of ``tubes`` with other values in some fields."""
    copy = np.array(tubes, TUBE)
    for name, value in values.items():
        copy[name] = value
    copy.flags.writeable = False
    return copy
