"""What every table of the configuration is made of: a strict model, and bounded numbers."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Length = Annotated[float, Field(gt=0, le=2, allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
Percent = Annotated[float, Field(gt=0, le=100)]


def unit(value: Vector) -> Vector:
    """``value`` at length 1; raises ``ValueError`` where it is zero."""
    norm = math.sqrt(sum(x * x for x in value))
    if norm < 1e-6:
        raise ValueError("a direction must not be zero")
    return (value[0] / norm, value[1] / norm, value[2] / norm)


def _not_zero(value: Vector) -> Vector:
    unit(value)
    return value


Direction = Annotated[Vector, AfterValidator(_not_zero)]


class Section(BaseModel):
    """A table of the configuration: unknown keys are refused, values cannot be changed later."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)
