"""What a calibration of the tendons found: how a command to the servos becomes a bend.

For each of the segment's coordinates

    bend = offset + gain * commanded - friction * f

where f, between -1 and 1, is the share of full friction that holds the tendons back: it follows
their motion in the disks over ``stick``, until they slide. Source: docs/derivations.md;
paper 1 has neither stretch nor friction.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from robot.errors import KeyholeError
from robot.section import Section

Gain = Annotated[float, Field(ge=0.3, le=1.5, allow_inf_nan=False)]
Small = Annotated[float, Field(ge=-0.5, le=0.5, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=0.5, allow_inf_nan=False)]
Tension = Annotated[float, Field(ge=-5.0, le=100.0, allow_inf_nan=False)]
Stick = Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)]


class TendonCalibration(Section):
    """What a sweep with tension cells found, for the sensing of shape and force.

    Attributes:
        bending_stiffness_n_m2: E I of the backbone.
        stiffness_uncertainty: relative standard deviation.
        friction: capstan coefficient of the tendons in the disks.
        friction_n: Coulomb part of their friction.
        friction_uncertainty: relative standard deviation of both.
        tendon_stiffness_n_m: of a tendon from pulley to tip, mean of the four.
        pretension_n: tension of each tendon while the segment is straight.
        residual_mm: rms of the tendon lengths that the model leaves unexplained.
    """

    bending_stiffness_n_m2: Annotated[float, Field(gt=0.0, le=0.1, allow_inf_nan=False)]
    stiffness_uncertainty: Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)]
    friction: Annotated[float, Field(ge=0.0, le=2.0, allow_inf_nan=False)]
    friction_n: Annotated[float, Field(ge=0.0, le=20.0, allow_inf_nan=False)]
    friction_uncertainty: Annotated[float, Field(gt=0.0, le=10.0, allow_inf_nan=False)]
    tendon_stiffness_n_m: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    pretension_n: tuple[Tension, Tension, Tension, Tension]
    residual_mm: Annotated[float, Field(ge=0.0)]


class Calibration(Section):
    """Of one robot; (u, v) in this order. The default is a robot without stretch and friction.

    Attributes:
        gain: bend over commanded bend.
        offset_rad: bend at a straight command.
        friction_rad: how far full friction holds the bend back.
        stick_rad: motion that takes friction from none to full.
        residual_deg: rms of what the model leaves unexplained in the sweep.
        samples: measurements behind it.
        tendons: what tension cells found; None of a robot without them.
        robot: which robot it is of, for people.
        configuration_hash: of the configuration it was made with, hexadecimal; empty for any.
        made: date and time, UTC, for people.
    """

    schema_version: Literal[1] = 1
    gain: tuple[Gain, Gain] = (1.0, 1.0)
    offset_rad: tuple[Small, Small] = (0.0, 0.0)
    friction_rad: tuple[Share, Share] = (0.0, 0.0)
    stick_rad: tuple[Stick, Stick] = (0.05, 0.05)
    residual_deg: Annotated[float, Field(ge=0.0)] = 0.0
    samples: Annotated[int, Field(ge=0)] = 0
    tendons: TendonCalibration | None = None
    robot: str = ""
    configuration_hash: str = ""
    made: str = ""


class CalibrationRefused(KeyholeError):
    """A calibration file holds what cannot be used.

    Attributes:
        file: its name.
    """

    code = "calibration"

    def __init__(self, file: str, reason: str) -> None:
        super().__init__(f"{file}: {reason}; make it anew with 'keyhole calibrate'")
        self.file = file


def parse_calibration(table: dict[str, Any], file: str) -> Calibration:
    """Validate what a TOML or JSON reader returned.

    Raises:
        CalibrationRefused: names the first wrong value and what is allowed.
    """
    try:
        return Calibration.model_validate(table)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"]) or "(whole file)"
        raise CalibrationRefused(file, f"{key} = {first['input']!r}: {first['msg']}") from None
