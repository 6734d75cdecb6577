"""What the API takes: every field with its unit, its bounds and an example."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    model_validator,
)

from robot.concentric.design import MethodName

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Millimetres = Annotated[float, Field(strict=True, ge=-10_000, le=10_000, allow_inf_nan=False)]
Component = Annotated[float, Field(strict=True, ge=-10, le=10, allow_inf_nan=False)]
Flag = Annotated[bool, Field(strict=True)]
Position = tuple[Millimetres, Millimetres, Millimetres]


def _unit(
    wxyz: tuple[float, float, float, float],
) -> tuple[float, float, float, float]:
    norm = math.sqrt(sum(part * part for part in wxyz))
    if norm < 1e-6:
        raise ValueError("the quaternion is zero; it must be (nearly) a unit quaternion")
    return (wxyz[0] / norm, wxyz[1] / norm, wxyz[2] / norm, wxyz[3] / norm)


Quaternion = Annotated[tuple[Component, Component, Component, Component], AfterValidator(_unit)]
OperatorName = Annotated[
    str,
    StringConstraints(
        strip_whitespace=True, min_length=1, max_length=40, pattern=r"^[^\x00-\x1f\x7f]+$"
    ),
]


class Body(BaseModel):
    """A request's body: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid")


class LeaseRequest(Body):
    """Who wants to drive."""

    operator: OperatorName = Field(description="Name shown to the others.", examples=["Ada"])


class HandOver(Body):
    """Who shall drive next."""

    to: OperatorName = Field(description="Name of the other operator.", examples=["Grace"])


class PriorityChange(Body):
    """What matters most below the remote centre of motion."""

    case: Literal["0", "1", "2", "pointing"] | None = Field(
        None,
        description="0 balanced, 1 linear first, 2 angular first, or pointing.",
        examples=["1"],
    )
    solver: Literal["hqp", "closed-form", "augmented"] | None = Field(
        None, description="Lexicographic QP with limits, or one of the paper's formulas."
    )
    coordinates: Literal["uv", "polar"] | None = Field(
        None, description="Segment coordinates of the formulas; the QP always uses u, v."
    )


class MethodChange(Body):
    """How the redundancy of the concentric-tube arms is resolved."""

    method: MethodName = Field(description="Takes effect with the next tick.", examples=["hqp"])


class TeleoperationChange(Body):
    """How the leader's motion becomes tip motion. What is left out stays as it is."""

    motion_scale: Number | None = Field(
        None, gt=0, description="Tip motion over leader motion, translation only.", examples=[0.5]
    )
    lock_rotation: Flag | None = Field(None, description="The tip keeps its orientation.")
    lock_translation: Flag | None = Field(None, description="The tip keeps its position.")
    alignment: Literal["relative", "matched"] | None = Field(
        None, description="Whether the leader must point as the tip does before it engages."
    )
    hold_to_move: Flag | None = Field(
        None, description="Motion only while hold-to-move is pressed (sent over the stream)."
    )
    view_wxyz: Quaternion | None = Field(
        None,
        description="Orientation of the operator's view in the base frame (x right, y up, z toward "
        "the operator): from then on leader motion along the view moves the tip along the view.",
        examples=[[1.0, 0.0, 0.0, 0.0]],
    )


class TargetPose(Body):
    """A tip pose in the base frame to go to, and to stay at."""

    position_mm: Position = Field(
        description="x, y, z in mm, base frame.", examples=[[455.0, 0.0, 20.0]]
    )
    orientation_wxyz: Quaternion | None = Field(
        None,
        description="Unit quaternion w, x, y, z, base frame; left out, the orientation is kept.",
    )


class LeaderPose(Body):
    """One sample of a clutched leader. Its motion counts from where the clutch closed."""

    position_mm: Position = Field(
        description="x, y, z in mm, in the leader's own frame.", examples=[[0.0, 0.0, 0.0]]
    )
    orientation_wxyz: Quaternion = Field(
        description="Unit quaternion w, x, y, z, in the leader's own frame.",
        examples=[[1.0, 0.0, 0.0, 0.0]],
    )
    clutch: Flag = Field(description="True while engaged; the tip does not jump when it closes.")


class PathStart(Body):
    """A path to play: an experiment by name, or samples as CSV."""

    experiment: Annotated[str, Field(min_length=1, max_length=80)] | None = Field(
        None, description="Name from GET experiments.", examples=["circle"]
    )
    csv: Annotated[str, Field(max_length=20_000_000)] | None = Field(
        None,
        description="Text with the columns time_s, x_mm, y_mm, z_mm, qw, qx, qy, qz: translation "
        "from the tip's start along the base frame's axes in mm, rotation in the base frame.",
    )
    name: Annotated[str, Field(min_length=1, max_length=80)] = Field(
        "path.csv", description="Name of the CSV, for messages."
    )

    @model_validator(mode="after")
    def _one_of_both(self) -> PathStart:
        if (self.experiment is None) == (self.csv is None):
            raise ValueError("give either experiment or csv")
        return self


class CompensationChange(Body):
    """How stretch and friction of the tendons are met, and whether a tracker is listened to."""

    mode: Literal["off", "gain", "full"] | None = Field(
        None, description="Not at all, the stretch as a gain, or friction as well."
    )
    tracker: Flag | None = Field(
        None, description="Whether what a tracker of the tip says corrects the tip."
    )


class SensingChange(Body):
    """Whether shape and force are estimated."""

    enabled: Flag = Field(description="Takes effect with the next tick.", examples=[True])


class TendonsChange(Body):
    """What the drives of the tendons hold."""

    control: Literal["position", "hybrid", "tension"] | None = Field(
        None,
        description="All their length; the pulled one of each pair its length and the loose one "
        "its tension; all their tension.",
        examples=["hybrid"],
    )
    co_contraction_n: Number | None = Field(
        None,
        ge=0.2,
        le=50,
        description="Tension that no tendon falls below where tensions are held, N.",
        examples=[2.0],
    )


class BoardChange(Body):
    """Which board shall stand before the instrument."""

    name: Annotated[str, Field(min_length=1, max_length=80)] = Field(
        description="Name from GET boards.", examples=["ring-board"]
    )


class TrocarRegistration(Body):
    """Where the trocar is: where the tip touches it, at a position, or as configured."""

    method: Literal["touch", "enter", "configuration"] = Field(examples=["enter"])
    position_mm: Position | None = Field(
        None,
        description="With enter: x, y, z in mm, base frame, between two breaths.",
        examples=[[400.0, 0.0, 120.0]],
    )

    @model_validator(mode="after")
    def _position_where_entered(self) -> TrocarRegistration:
        if (self.method == "enter") != (self.position_mm is not None):
            raise ValueError("give position_mm with the method enter, and with no other")
        return self


class BreathingChange(Body):
    """How the trocar breathes. What is left out stays as it is."""

    amplitude_mm: Annotated[float, Field(strict=True, ge=0, le=10, allow_inf_nan=False)] | None = (
        Field(None, description="How far a breath carries it out; 0 for a still one.")
    )
    period_s: Annotated[float, Field(strict=True, ge=1, le=20, allow_inf_nan=False)] | None = Field(
        None, description="Length of a breath in s."
    )


class LeaseGrant(BaseModel):
    """The lease of the operator."""

    lease_id: str = Field(description="Send it as header X-Keyhole-Lease with every request.")
    operator: str
    expires_in_s: float = Field(description="Seconds until it ends unless it is renewed.")


class LeaderAnswer(BaseModel):
    """The sample was passed on."""

    sequence: int = Field(description="Number of the sample.")


class RobotEntry(BaseModel):
    """One robot of this console."""

    name: str
    title: str
    selected: bool = Field(description="Whether it is the one that is driven now.")


class RobotSelected(BaseModel):
    """The robot that is driven from now on."""

    robot: str


class ExperimentEntry(BaseModel):
    """One experiment."""

    name: str
    title: str
    duration_s: float = Field(description="Length in s.")
    board: str | None = Field(
        description="Board that must stand there: null for any, none where there must be room."
    )
    arm_locked: bool = Field(description="Whether the arm stands still meanwhile.")
    cases: list[str] = Field(description="Priority cases under which the paper runs it.")
    marks_s: list[float] = Field(
        description="Times that matter: over a peg, half-way through a ring, bend before direction."
    )


class BoardEntry(BaseModel):
    """One board."""

    name: str
    title: str
    present: bool = Field(description="Whether it stands before the instrument now.")


class TrocarEntry(BaseModel):
    """Where the trocar is, and how the shaft stands to it."""

    model_config = ConfigDict(populate_by_name=True)

    position_mm: list[float] = Field(description="Now, base frame.")
    registered_mm: list[float] = Field(description="Between two breaths, base frame.")
    method: Literal["configuration", "touch", "enter"]
    distance_mm: float = Field(description="From the trocar to the shaft's axis.")
    lambda_: float = Field(alias="lambda", description="Where it stands along the shaft.")
    inserted: bool = Field(description="Whether the robot may be enabled with it.")
    breathing_amplitude_mm: float
    breathing_period_s: float


class TransitionEntry(BaseModel):
    """One row of the safety table: in ``state``, ``event`` leads to ``next``."""

    state: str
    event: str
    next: str
    request: bool = Field(description="Whether people ask for it; else it happens by itself.")
    reason: str
    action: str = Field(description="What to do then, or empty.")


class Health(BaseModel):
    """That the server answers, and what it can show."""

    status: Literal["ok"]
    version: str
    scene: str = Field(description="loading, ready, or why there is no scene.")
