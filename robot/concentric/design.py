"""The ``[concentric]`` tables of the configuration: tubes, arms, gains, limits, starts."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from robot.section import Finite, NotNegative, Positive, Section, Vector

MethodName = Literal["nspwln", "nspwln-repaired", "nspqp", "snsqp", "hqp"]
METHODS: tuple[MethodName, ...] = get_args(MethodName)
ClosedShare = Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)]


class TubeDesign(Section):
    """One pre-curved tube; the same tubes make both arms. The first is the innermost."""

    outer_diameter_mm: Positive
    inner_diameter_mm: NotNegative
    youngs_modulus_gpa: Positive
    stiffness_ratio: Annotated[float, Field(ge=0.1, le=10)]
    straight_length_mm: NotNegative
    curved_length_mm: NotNegative
    curvature_per_m: Annotated[float, Field(ge=0, le=200)]

    @property
    def length_mm(self) -> float:
        """Straight and curved length together, mm."""
        return self.straight_length_mm + self.curved_length_mm

    @model_validator(mode="after")
    def _has_a_wall_and_a_length(self) -> TubeDesign:
        if self.inner_diameter_mm >= self.outer_diameter_mm:
            raise ValueError("inner_diameter_mm must be below outer_diameter_mm")
        if self.length_mm <= 0.0:
            raise ValueError("straight_length_mm + curved_length_mm must be above 0")
        return self


Tubes = Annotated[tuple[TubeDesign, ...], Field(min_length=1, max_length=6)]
Translations = tuple[Finite, ...]


class ConcentricStart(Section):
    """A configuration of both arms: translations and rotations of their tubes, innermost first."""

    translations_a_mm: Translations
    rotations_a_deg: Translations
    translations_b_mm: Translations
    rotations_b_deg: Translations


class ConcentricLimits(Section):
    """What the concentric-tube arms never leave."""

    translation_speed_mm_s: Positive
    translation_acceleration_mm_s2: Positive
    rotation_speed_rad_s: Positive
    minimum_segment_mm: NotNegative
    motor_spacing_mm: NotNegative
    stability_margin: ClosedShare
    relative_error_mm: Positive
    tip_speed_mm_s: Positive
    tip_acceleration_mm_s2: Positive
    target_distance_mm: Positive
    tip_jump_mm: Positive
    tracking_error_mm: Positive
    tracking_error_deg: Positive
    workspace_min_m: Vector
    workspace_max_m: Vector


class Concentric(Section):
    """Two concentric-tube arms through one endoscope."""

    rate_hz: Annotated[float, Field(ge=10, le=500)]
    method: MethodName
    channel_spacing_mm: NotNegative
    endoscope_diameter_mm: Positive
    endoscope_length_mm: Positive
    relative_gain_per_s: Positive
    tracking_gain_per_s: Positive
    start: Annotated[int, Field(ge=1)]
    limits: ConcentricLimits
    tubes: Tubes
    starts: Annotated[tuple[ConcentricStart, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _tubes_fit_into_each_other(self) -> Concentric:
        for inner, outer in zip(self.tubes, self.tubes[1:], strict=False):
            if inner.outer_diameter_mm >= outer.inner_diameter_mm:
                raise ValueError(
                    "tubes stand from the innermost outward: each outer_diameter_mm must be below "
                    "the next tube's inner_diameter_mm"
                )
            if inner.length_mm <= outer.length_mm:
                raise ValueError("each tube must be longer than the one around it")
        return self

    @model_validator(mode="after")
    def _starts_match_the_tubes(self) -> Concentric:
        if self.start > len(self.starts):
            raise ValueError(f"start must be one of 1 to {len(self.starts)}")
        for number, start in enumerate(self.starts, 1):
            for name in type(start).model_fields:
                if len(getattr(start, name)) != len(self.tubes):
                    raise ValueError(
                        f"starts: number {number}: {name} needs a value for each tube "
                        f"({len(self.tubes)})"
                    )
        return self

    @model_validator(mode="after")
    def _workspace_box(self) -> Concentric:
        corners = zip(self.limits.workspace_min_m, self.limits.workspace_max_m, strict=True)
        if not all(low < high for low, high in corners):
            raise ValueError("limits.workspace_min_m must be below workspace_max_m on every axis")
        return self
