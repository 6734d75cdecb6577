"""Which control of the tendons a robot can be asked for: what its cells and its backbone permit."""

from __future__ import annotations

import numpy as np

from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.records import SERVOS
from robot.sensing.parameters import chord_length
from robot.tension.records import TendonControl, TendonMode
from robot.tension.stiffness import chord_curvatures, joint_stiffness
from robot.tension.structures import four_tendons

LEAST_STIFFNESS = 0.3
"""Share of the backbone's stiffness that tensions must leave."""
CONTROL_NAMES = {
    "position": TendonControl.POSITION,
    "hybrid": TendonControl.HYBRID,
    "tension": TendonControl.TENSION,
}


class TensionsNotMeasured(KeyholeError):
    """Tendons are to hold tensions on a robot that measures none.

    Attributes:
        control: what was asked for.
    """

    code = "tensions_not_measured"

    def __init__(self, control: str) -> None:
        super().__init__(
            f"{control} control needs a robot that measures the tension of its tendons: start with "
            "--actuation tension-unit, or hold positions"
        )
        self.control = control


class CoContractionRefused(KeyholeError):
    """The tendons would be tightened until the segment buckles, or beyond what they may carry.

    Attributes:
        wanted: asked for, N.
        largest: that can be had, N.
    """

    code = "co_contraction"

    def __init__(self, wanted: float, largest: float, why: str) -> None:
        super().__init__(
            f"a co-contraction of {wanted:g} N is refused: {why}; ask for at most {largest:.3g} N"
        )
        self.wanted, self.largest = wanted, largest


def bending_stiffness(
    configuration: Configuration, modes: np.ndarray, tensions: np.ndarray
) -> np.ndarray:
    """Stiffness (2, 2) of the bend (u, v), N m/rad, as the configuration assumes the robot.

    Args:
        configuration: of the robot.
        modes: (4,) each a ``TendonMode``: a tendon that holds a length is stiff.
        tensions: (4,) N; they soften the bend of straight chords between disks.
    """
    instrument, sensing = configuration.instrument, configuration.sensing
    structure = four_tendons(instrument.tendon_pitch_radius_m)
    stiff = np.where(modes == TendonMode.POSITION, sensing.tendon_stiffness_n_m, 0.0)
    curvatures = chord_curvatures(structure, chord_length(instrument))
    elastic = sensing.bending_stiffness_n_m2 / instrument.segment_length_m
    return joint_stiffness(structure, tensions, stiff, curvatures, elastic * np.eye(2))


def largest_co_contraction(configuration: Configuration) -> tuple[float, str]:
    """What may be asked for where tensions are held, N, and what limits it.

    Tensions on straight chords between disks soften every mode of bending alike. Whatever lengths
    are held, nothing but the backbone holds the modes that leave them as they are (an S).
    """
    half = 0.5 * configuration.tendons.tension_limit_n
    all_hold_tension = np.full(SERVOS, TendonMode.TENSION)
    free = bending_stiffness(configuration, all_hold_tension, np.zeros(SERVOS))[0, 0]
    per_newton = free - bending_stiffness(configuration, all_hold_tension, np.ones(SERVOS))[0, 0]
    soft = float((1.0 - LEAST_STIFFNESS) * free / per_newton)
    if soft >= half:
        return half, "half of tendons.tension_limit_n is left for bending"
    return soft, f"less than {LEAST_STIFFNESS:.0%} of the backbone's stiffness would be left"


def check_tendons(
    configuration: Configuration, control: str, co_contraction_n: float, cells: bool
) -> None:
    """Refuse what the robot cannot hold.

    Args:
        configuration: of the robot.
        control: a name of ``CONTROL_NAMES``.
        co_contraction_n: N.
        cells: whether the robot measures tensions.

    Raises:
        TensionsNotMeasured: tensions are to be held, and nothing measures them.
        CoContractionRefused: see there.
    """
    if control != "position" and not cells:
        raise TensionsNotMeasured(control)
    largest, why = largest_co_contraction(configuration)
    if control != "position" and co_contraction_n > largest:
        raise CoContractionRefused(co_contraction_n, largest, why)


def measures_tension(configuration: Configuration) -> bool:
    """Whether the robot that ``configuration`` describes has torque cells."""
    simulation = configuration.simulation
    simulated = simulation.plant == "physics" and not configuration.hardware.connected
    return simulated and simulation.actuation == "tension-unit"


def check_configured(configuration: Configuration) -> None:
    """Refuse a configuration that asks its tendons for what they cannot do; see
    :func:`check_tendons`.
    """
    tendons = configuration.tendons
    cells = measures_tension(configuration)
    check_tendons(configuration, tendons.control, tendons.co_contraction_n, cells)
