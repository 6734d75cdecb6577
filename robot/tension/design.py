"""The table ``[tendons]`` of the configuration."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot.section import Positive, Section

TendonControlName = Literal["position", "hybrid", "tension"]


class Tendons(Section):
    """What the drives of the tendons hold, on a robot that measures their tension."""

    control: TendonControlName
    co_contraction_n: Annotated[float, Field(ge=0.2, le=50)]
    tension_limit_n: Annotated[float, Field(ge=1, le=200)]
    tension_rate_n_s: Annotated[float, Field(gt=0, le=500)]
    travel_mm: Positive

    @model_validator(mode="after")
    def _room_to_bend(self) -> Tendons:
        if self.co_contraction_n > 0.5 * self.tension_limit_n:
            raise ValueError("co_contraction_n must not exceed half of tension_limit_n")
        return self
