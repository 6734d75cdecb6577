"""Both arms at random configurations, and rate problems there."""

from __future__ import annotations

import functools

import numpy as np

from robot.concentric.control import PairControl
from robot.concentric.design import Concentric
from robot.concentric.kinematics import SOLVED
from robot.concentric.methods.rate_problem import RateProblem
from robot.concentric.pair import ArmPair, PairKinematics, start_of
from robot.concentric.proximal import Proximal
from scenes.experiments.tube_starts import random_starts
from server.configuration_file import load

PERIOD = 0.1
TUBES = 3


@functools.cache
def design() -> Concentric:
    """The paper's tubes."""
    return load(None).concentric


@functools.cache
def pair() -> ArmPair:
    """Their model."""
    return ArmPair(design())


@functools.cache
def _random() -> np.ndarray:
    return random_starts(design(), 12, 11)


def configurations() -> list[np.ndarray]:
    """The paper's three, and twelve random ones."""
    return [*(start_of(start) for start in design().starts), *_random().copy()]


def at(q: np.ndarray) -> PairKinematics:
    """Both arms evaluated at q_AB."""
    found = PairKinematics(TUBES)
    found.q[:] = q
    assert pair().evaluate_cold(found) == SOLVED
    return found


def rate_problem(
    q: np.ndarray, rng: np.random.Generator, speed: float = 0.005, period: float = PERIOD
) -> RateProblem:
    """Both tasks wanted at up to ``speed``, m/s, in each direction."""
    now = at(q)
    found = RateProblem(Proximal(design()), design().limits.rotation_speed_rad_s, period)
    found.stand_at(q)
    found.relative_jacobian[:] = now.relative_jacobian
    found.tracking_jacobian[:] = now.tracking_jacobian
    found.relative_velocity[:] = rng.uniform(-speed, speed, 3)
    found.tracking_velocity[:] = rng.uniform(-speed, speed, 3)
    return found


def control(method: str, period: float = PERIOD) -> PairControl:
    """A control by this method."""
    return PairControl(design(), period, method)
