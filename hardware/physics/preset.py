"""How good the simulated robot is: three presets, and what a seed draws around them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Preset:
    """What a simulated robot is made of, and how far it is from its drawings.

    Attributes:
        name: as on the command line.
        backbone_diameter_m: of the segment's NiTi rod; its stiffness against the tendons' decides
            how much of a command is lost to stretch.
        tendon_stiffness_n_m: EA / L of a tendon from pulley to tip.
        pretension_n: of every tendon while the segment is straight.
        tendon_friction_n: Coulomb friction of a tendon in the disks.
        tendon_stick_m: how far a tendon creeps elastically before it slides.
        servo_lag_s: time constant of the four servos.
        servo_speed_rad_s: their largest speed.
        servo_ticks: whether they stop at whole ticks.
        joint_lag_s: (7,) time constants of the joint servos.
        joint_stiffness_nm_rad: (7,) of the joint servos and gears.
        payload_error: share of the module's weight that the arm does not know of.
        origin_error_m: how far every joint's origin is from the drawings, in a random direction.
        axis_error_rad: how far every joint's frame is turned, about a random axis.
        spread: relative standard deviation of friction, pretension and tendon stiffness between
            robots and tendons of this preset.
    """

    name: str
    backbone_diameter_m: float
    tendon_stiffness_n_m: float
    pretension_n: float
    tendon_friction_n: float
    tendon_stick_m: float
    servo_lag_s: float
    servo_speed_rad_s: float
    servo_ticks: bool
    joint_lag_s: tuple[float, ...]
    joint_stiffness_nm_rad: tuple[float, ...]
    payload_error: float
    origin_error_m: float
    axis_error_rad: float
    spread: float


_STIFF = (8000.0, 8000.0, 6000.0, 6000.0, 5000.0, 4000.0, 4000.0)

IDEAL = Preset(
    name="ideal",
    backbone_diameter_m=0.4e-3,
    tendon_stiffness_n_m=200e3,
    pretension_n=1.0,
    tendon_friction_n=0.0,
    tendon_stick_m=20e-6,
    servo_lag_s=0.001,
    servo_speed_rad_s=math.radians(600.0),
    servo_ticks=False,
    joint_lag_s=(0.001,) * 7,
    joint_stiffness_nm_rad=(1e5,) * 7,
    payload_error=0.0,
    origin_error_m=0.0,
    axis_error_rad=0.0,
    spread=0.0,
)
"""Stiff, frictionless and as drawn; what is left is the chain of twelve links and its mass."""

PAPER = Preset(
    name="paper",
    backbone_diameter_m=0.4e-3,
    tendon_stiffness_n_m=7554.0,
    pretension_n=2.0,
    tendon_friction_n=0.5,
    tendon_stick_m=20e-6,
    servo_lag_s=0.015,
    servo_speed_rad_s=math.radians(300.0),
    servo_ticks=True,
    joint_lag_s=(0.010, 0.013, 0.016, 0.019, 0.022, 0.026, 0.030),
    joint_stiffness_nm_rad=_STIFF,
    payload_error=0.1,
    origin_error_m=0.1e-3,
    axis_error_rad=0.0,
    spread=0.05,
)
"""Tuned so that the actuation test errs as the authors' hardware did (paper 1, section 5.2): a fit
to two printed figures, not a validation."""

HARSH = replace(
    PAPER,
    name="harsh",
    backbone_diameter_m=0.5e-3,
    tendon_friction_n=0.9,
    servo_lag_s=0.03,
    joint_lag_s=tuple(1.5 * lag for lag in PAPER.joint_lag_s),
    joint_stiffness_nm_rad=tuple(0.5 * stiffness for stiffness in _STIFF),
    payload_error=0.3,
    origin_error_m=0.3e-3,
    axis_error_rad=math.radians(0.05),
    spread=0.15,
)
"""A robot that wants repair: what the controller must survive, not what it must master."""

PRESETS = {preset.name: preset for preset in (IDEAL, PAPER, HARSH)}


@dataclass(frozen=True)
class Drawn:
    """What a seed draws for one robot; frames as in the configuration's arm.

    Attributes:
        origin_offsets_m: (7, 3) added to the joints' origins, each in its own frame.
        axis_turns_rad: (7, 3) rotation vectors that turn the joints' frames.
        stiffness_n_m: (4,) of the tendons.
        pretension_n: (4,).
        friction_n: (4,).
    """

    origin_offsets_m: np.ndarray
    axis_turns_rad: np.ndarray
    stiffness_n_m: np.ndarray
    pretension_n: np.ndarray
    friction_n: np.ndarray


def _directions(generator: np.random.Generator, count: int) -> np.ndarray:
    vectors = generator.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def draw(preset: Preset, generator: np.random.Generator) -> Drawn:
    """One robot of a preset.

    Args:
        preset: what it is drawn around.
        generator: its state decides, and is advanced.
    """
    offsets = preset.origin_error_m * _directions(generator, 7)
    turns = preset.axis_error_rad * _directions(generator, 7)

    def around(value: float) -> np.ndarray:
        share = np.clip(generator.normal(size=4), -2.0, 2.0)
        return np.asarray(value * (1.0 + preset.spread * share))

    return Drawn(
        offsets,
        turns,
        around(preset.tendon_stiffness_n_m),
        around(preset.pretension_n),
        around(preset.tendon_friction_n),
    )
