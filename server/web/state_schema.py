"""The state message as a schema, for the API's documentation and for the tests.

Messages are made by :mod:`server.web.state_message` and never pass through these models.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from robot.concentric.design import MethodName
from server.web.device_schema import ClearancePart, DevicesPart, ReadinessPart

Millimetres = list[float | None]
Newtons = list[float | None]


class Part(BaseModel):
    """A part of the message; numbers are null where they are not known."""

    model_config = ConfigDict(extra="forbid")


class SafetyPart(Part):
    """The safety state, why, and what to do."""

    state: Literal["DISABLED", "ENABLED", "PAUSED", "FAULT"]
    reason: str
    reason_code: str
    action: str


class OperatorPart(Part):
    """Who drives."""

    name: str | None
    you: bool
    expires_in_s: float | None
    offered_to: str | None = Field(description="To whom control is offered.")
    asked_by: str | None = Field(description="Who asks for control.")


class PriorityPart(Part):
    """What matters most."""

    case: Literal["0", "1", "2", "pointing"]
    solver: Literal["hqp", "closed-form", "augmented"]
    coordinates: Literal["uv", "polar"]


class TeleoperationPart(Part):
    """How the leader's motion becomes tip motion."""

    motion_scale: float | None
    motion_scale_min: float | None
    motion_scale_max: float | None
    lock_rotation: bool
    lock_translation: bool
    alignment: Literal["relative", "matched"]
    hold_to_move: bool


class ErrorsPart(Part):
    """Desired minus true (a simulation) or minus measured; RCM: trocar to shaft axis."""

    position_mm: float | None
    orientation_deg: float | None
    rcm_mm: float | None
    source: Literal["true", "measured"]


class LambdaPart(Part):
    """Where the trocar touches the shaft: 0 at its base, 1 at its end."""

    value: float | None
    reference: float | None
    min: float | None
    max: float | None


class PosePart(Part):
    """A pose in the base frame."""

    position_mm: Millimetres = Field(min_length=3, max_length=3)
    orientation_wxyz: list[float | None] = Field(min_length=4, max_length=4)


class ResidualsPart(Part):
    """What each level of priority could not do."""

    rcm_mm_s: float | None
    linear_mm_s: float | None
    angular_deg_s: float | None


class LoopPart(Part):
    """Health of the control loop."""

    rate_hz: float | None
    overruns: int | None
    lateness_us: float | None
    tick_us: float | None
    realtime: str
    real_time_factor: float | None


class PathPart(Part):
    """The path that plays."""

    name: str | None
    progress: float | None = Field(description="0 to 1.")


class TrocarPart(Part):
    """How the trocar was registered, and how it was last asked to breathe."""

    method: Literal["configuration", "touch", "enter"]
    breathing_amplitude_mm: float | None
    breathing_period_s: float | None


class TrackerPart(Part):
    """A tracker of the tip, and the correction that it led to."""

    on: bool
    age_ms: float | None = Field(description="Of its newest sample; null without one.")
    correction_mm: float | None
    correction_deg: float | None


class ForceAxisPart(Part):
    """One axis of the uncertainty of the sensed force."""

    direction: list[float | None] = Field(
        min_length=3, max_length=3, description="Unit vector, base frame."
    )
    component_n: float | None = Field(description="Of the force, never negative.")
    deviation_n: float | None = Field(description="Its standard deviation.")
    observable: bool = Field(
        description="False where the deviation is at least half of expected_n: hardly anything "
        "was learned along this axis."
    )


class SensingPart(Part):
    """Shape and force as estimated from tip pose and tendon tensions; null while not valid."""

    enabled: bool
    valid: bool
    fault: str = Field(description="Why there is no estimate, for programs; none while valid.")
    reason: str
    action: str
    force_n: Newtons = Field(
        min_length=3, max_length=3, description="Of the environment on the tip, base frame."
    )
    magnitude_n: float | None
    deviation_n: float | None = Field(
        description="Standard deviation of the force along its own direction."
    )
    expected_n: float = Field(
        description="Standard deviation of the forces that are expected beforehand."
    )
    axes: list[ForceAxisPart] = Field(
        max_length=3, description="The best known first; empty while not valid."
    )
    true_force_n: Newtons = Field(
        min_length=3,
        max_length=3,
        description="Of all contacts on the instrument together, base frame; simulation only.",
    )
    tip: PosePart = Field(description="As estimated.")
    cells: bool = Field(description="Whether the robot measures the tension of its tendons.")
    tension_n: Newtons = Field(
        min_length=4, max_length=4, description="As estimated, at the segment's base."
    )
    tension_full_scale_n: float = Field(description="End of a tension cell's range.")


class ContactPart(Part):
    """What the instrument touches."""

    count: int | None
    force_n: float | None = Field(description="The largest, as a sensor reads it.")
    limit_n: float | None = Field(description="Above it the motion pauses.")


class RingsPart(Part):
    """How many rings of the board the tip was half-way through, and how many it touched."""

    passed: int | None
    touched: int | None
    total: int | None


class BallPart(Part):
    """How far the ball is along its groove."""

    progress: float | None = Field(description="0 to 1.")


class ReplayPart(Part):
    """What is shown of a recording."""

    file: str
    time_s: float = Field(description="Since the recording's start, s.")
    duration_s: float = Field(description="Length of the recording, s.")
    playing: bool
    speed: float = Field(description="Recorded time over real time.")
    started: str = Field(description="When it was recorded, UTC.")
    cut: bool = Field(description="Whether the recording was cut off.")


class TendonsPart(Part):
    """What the drives of the tendons hold; a number for each tendon."""

    control: Literal["position", "hybrid", "tension"]
    co_contraction_n: float | None = Field(
        description="Tension that no tendon falls below where tensions are held."
    )
    largest_co_contraction_n: float | None = Field(description="That may be asked for.")
    holds: list[Literal["position", "tension"]] = Field(min_length=4, max_length=4)
    wanted_n: Newtons = Field(
        min_length=4, max_length=4, description="Null where a length is held."
    )
    stiffness_mnm_rad: list[float | None] = Field(
        min_length=2,
        max_length=2,
        description="Of the bend u and v, by the model; null where no tension is measured.",
    )


class SharedState(Part):
    """What is told of every robot at one tick. Positions and poses in the base frame."""

    type: Literal["state"]
    schema_version: Literal[1]
    tick: int | None
    time_s: float | None = Field(description="The plant's clock, s.")
    age_ms: float | None = Field(description="Since the record was published, ms.")
    safety: SafetyPart
    operator: OperatorPart
    engaged: bool
    leader: Literal["none", "gizmo", "api_pose", "api_target", "path", "stylus", "gamepad"]
    hold: bool
    teleoperation: TeleoperationPart
    desired: PosePart
    commanded: PosePart
    true: PosePart
    limits: list[str] = Field(description="Limits that hold the motion back, in words.")
    loop: LoopPart
    path: PathPart | None
    plant: str
    preset: str | None = Field(description="Of the simulated robot; null for the kinematic one.")
    seed: int | None = Field(description="Likewise.")
    readiness: ReadinessPart
    devices: DevicesPart
    recording: bool
    replay: ReplayPart | None = Field(description="Null where there is a robot.")
    control: Literal["running", "starting", "down"]


class StateMessage(SharedState):
    """The instrument on its arm."""

    robot: Literal["instrument"]
    priority: PriorityPart
    errors: ErrorsPart
    lambda_: LambdaPart = Field(alias="lambda")
    bend_deg: float | None
    bend_limit_deg: float | None
    direction_deg: float | None
    joints_deg: list[float | None] = Field(min_length=7, max_length=7)
    joint_limits_deg: list[list[float | None]] = Field(min_length=7, max_length=7)
    servos_deg: list[float | None] = Field(min_length=4, max_length=4)
    trocar_mm: Millimetres = Field(min_length=3, max_length=3)
    trocar: TrocarPart
    clearance: ClearancePart
    compensation: Literal["off", "gain", "full"]
    tracker: TrackerPart
    tension_n: Newtons = Field(
        min_length=4,
        max_length=4,
        description="As measured; null where nothing measures it.",
    )
    sensing: SensingPart
    tendons: TendonsPart
    actuation: Literal["servos", "tension-unit"] | None = Field(
        description="What drives the tendons of the simulated robot; null for any other."
    )
    contact: ContactPart
    rings: RingsPart | None = Field(description="Null without rings.")
    ball: BallPart | None = Field(description="Null without a ball.")
    residuals: ResidualsPart
    board: str = Field(description="Name of the board before the instrument.")


class RelativeErrorsPart(Part):
    """Desired minus true: of A's tip, and of B's tip from its place beside A's."""

    position_mm: float | None
    relative_mm: float | None
    source: Literal["true", "measured"]


class TubeArmPart(Part):
    """One arm; a number for each tube, the innermost first."""

    name: Literal["A", "B"]
    translations_mm: list[float | None] = Field(
        description="Where each tube's rear end stands behind the endoscope's face, as commanded."
    )
    translations_measured_mm: list[float | None]
    lower_mm: list[float | None] = Field(description="Bounds that move with the tube inside.")
    upper_mm: list[float | None]
    rotations_deg: list[float | None]
    stability: float | None = Field(description="1 far from snapping, 0 where the tubes snap.")


class TaskScalePart(Part):
    """Share of each task that the method carried out (``snsqp`` scales tasks; others do not)."""

    relative: float | None
    tracking: float | None


class ConcentricState(SharedState):
    """Two concentric-tube arms: the led tip is A's."""

    robot: Literal["concentric"]
    method: MethodName
    errors: RelativeErrorsPart
    relative_limit_mm: float = Field(description="More than this pauses the motion.")
    stability_limit: float = Field(description="Less than this is not approached.")
    desired_b_mm: Millimetres = Field(min_length=3, max_length=3)
    commanded_b: PosePart
    true_b: PosePart
    arms: list[TubeArmPart] = Field(min_length=2, max_length=2)
    task_scale: TaskScalePart
