"""The simulated rod put through the programmes of the sensing experiments.

Only what happens to the rod stands here; no estimator sees any of it but through noisy sensors.
"""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from hardware.rod.platform import Platform
from hardware.rod.properties import RodProperties
from hardware.rod.rod import Rod, RodShape
from robot.errors import KeyholeError
from scenes.experiments.sensing import (
    CONTACT_BEND,
    LEVEL_PULLS_N,
    PLATFORM_STIFFNESS_N_M,
    PRETENSION_N,
    TOUCHING_DEG,
    Bend,
    PullStop,
    pull_release,
)
from server.run.sensing_options import SPREAD

_LARGEST_PULL_N = 12.0
_PULL_TOLERANCE_N = 1e-6
_STEP_N = 0.25
_BESIDE_N = 1e-3


class BendNotReached(KeyholeError):
    """No pull bends the simulated rod so far.

    Attributes:
        theta_deg: the bend that was wanted.
        pull_n: the largest pull tried.
    """

    code = "bend_not_reached"

    def __init__(self, theta_deg: float, pull_n: float) -> None:
        super().__init__(
            f"the rod does not bend by {theta_deg:g} deg at a pull of {pull_n:g} N; "
            "give less --friction"
        )
        self.theta_deg, self.pull_n = theta_deg, pull_n


class Stop(NamedTuple):
    """The rod standing still.

    Attributes:
        tensions: (4,) at the base, N.
        shape: of the rod.
    """

    tensions: np.ndarray
    shape: RodShape


class Approach(NamedTuple):
    """How a bend was approached.

    Attributes:
        stops: on the way there, one after the other from the straight rod.
        rod: at the last of them.
        pull: there, N.
    """

    stops: list[Stop]
    rod: Rod
    pull: float


class Levels(NamedTuple):
    """The rod pressed on the platform, level after level.

    Attributes:
        way: stops before it touches.
        levels: the five.
        normal: (3,) out of the platform.
        pulls: (5,) N.
    """

    way: list[Stop]
    levels: list[Stop]
    normal: np.ndarray
    pulls: np.ndarray


def drawn_properties(friction: float, rng: np.random.Generator) -> RodProperties:
    """A rod of its own: stiffness and friction drawn around the nominal ones."""
    nominal = RodProperties()
    stiffer, rougher = (1.0 + SPREAD * np.clip(rng.normal(size=2), -3.0, 3.0)).tolist()
    return RodProperties(
        bending_stiffness_n_m2=stiffer * nominal.bending_stiffness_n_m2,
        torsion_stiffness_n_m2=stiffer * nominal.torsion_stiffness_n_m2,
        friction=rougher * friction,
    )


def bend_of(shape: RodShape) -> float:
    """Angle between the tip's axis and the base's, rad."""
    return math.acos(max(-1.0, min(1.0, float(shape.tip_rotation[2, 2]))))


def _at_rest(properties: RodProperties) -> Rod:
    rod = Rod(properties)
    rod.step(np.full(4, PRETENSION_N))
    return rod


def swept(properties: RodProperties) -> list[tuple[PullStop, RodShape]]:
    """The pull-release programme, free of contact."""
    rod = _at_rest(properties)
    return [(stop, rod.step(stop.tensions)) for stop in pull_release()]


def pulled_to(properties: RodProperties, bend: Bend) -> Approach:
    """Pull the straight rod, free of contact, until it bends as far as wanted.

    Raises:
        BendNotReached: it never does.
    """
    rod, wanted = _at_rest(properties), math.radians(bend.theta_deg)
    stops: list[Stop] = []
    pull = 0.0

    def beyond(trial: float) -> float:
        return bend_of(copy.copy(rod).step(bend.tensions(trial))) - wanted

    while beyond(pull + _STEP_N) < 0.0:
        pull += _STEP_N
        if pull > _LARGEST_PULL_N:
            raise BendNotReached(bend.theta_deg, pull)
        stops.append(Stop(bend.tensions(pull), rod.step(bend.tensions(pull))))
    pull = float(brentq(beyond, pull, pull + _STEP_N, xtol=_PULL_TOLERANCE_N))
    stops.append(Stop(bend.tensions(pull), rod.step(bend.tensions(pull))))
    return Approach(stops, rod, pull)


def pressed(properties: RodProperties) -> Levels:
    """Pull the rod until its tip touches a platform that faces its motion, and further by levels.

    Raises:
        BendNotReached: it does not get to the platform.
    """
    bend = Bend(TOUCHING_DEG, CONTACT_BEND.delta_deg)
    touching = pulled_to(properties, bend)
    after = copy.copy(touching.rod).step(bend.tensions(touching.pull + _BESIDE_N))
    place = touching.rod.shape.tip_position
    normal = place - after.tip_position
    normal /= np.linalg.norm(normal)
    touching.rod.platform = Platform(
        tuple(place.tolist()), tuple(normal.tolist()), PLATFORM_STIFFNESS_N_M
    )
    pulls = touching.pull + np.array(LEVEL_PULLS_N)
    levels = [
        Stop(bend.tensions(pull), touching.rod.step(bend.tensions(pull))) for pull in pulls.tolist()
    ]
    return Levels(touching.stops, levels, normal, pulls)
