"""The table ``[sensing]`` of the configuration."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot.section import NotNegative, Percent, Positive, Section


class Sensing(Section):
    """What shape and force are estimated with, until a calibration knows better."""

    enabled: bool
    bending_stiffness_n_m2: Annotated[float, Field(gt=0, le=0.1)]
    torsion_ratio: Annotated[float, Field(ge=0.1, le=1000)]
    stiffness_uncertainty_percent: Percent
    tendon_friction: Annotated[float, Field(ge=0, le=2)]
    tendon_friction_n: Annotated[float, Field(ge=0, le=20)]
    friction_uncertainty_percent: Percent
    tendon_stiffness_n_m: Positive
    pretension_n: NotNegative
    tension_noise_n: Positive
    tendon_length_noise_mm: Positive
    balance_noise_n_mm: Positive
    force_expected_n: Positive
    tension_full_scale_n: Positive
    broken_tendon_n: NotNegative
