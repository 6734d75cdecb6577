"""The one configuration: every dimension, limit and behaviour, validated, units in the names.

The models mirror ``keyhole.toml`` beside this module. They read no files themselves; give
:func:`parse` what a TOML reader returned.
"""

from __future__ import annotations

import hashlib
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from robot.concentric.design import Concentric
from robot.errors import ConfigurationError
from robot.section import (
    Direction,
    Finite,
    Length,
    NotNegative,
    Percent,
    Positive,
    Section,
    Vector,
    unit,
)
from robot.sensing.design import Sensing
from robot.tension.design import Tendons
from robot.tension_unit_design import TensionUnit

SCHEMA_VERSION = 1

RobotName = Literal["instrument", "concentric"]
ServoId = Annotated[int, Field(ge=0, le=252)]
Sign = Literal[-1, 1]
DriveName = Literal["both", "arm", "segment", "none"]
BreathingAmplitude = Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)]
BreathingPeriod = Annotated[float, Field(ge=1, le=20, allow_inf_nan=False)]


class Trocar(Section):
    """Where the shaft passes the body wall (base frame), the wall's looks, and its breathing."""

    position_m: Vector
    wall_normal: Direction
    wall_radius_m: Length
    wall_thickness_m: Length
    breathing_amplitude_mm: BreathingAmplitude
    breathing_period_s: BreathingPeriod


class Start(Section):
    """The configuration in which the robot wakes up."""

    shaft_direction: Direction
    bend_direction_up: Direction
    bend_deg: Annotated[float, Field(ge=0, le=170)]
    direction_deg: Annotated[float, Field(ge=-360, le=360)]
    lambda_along_shaft: Annotated[float, Field(gt=0, lt=1)]

    @model_validator(mode="after")
    def _up_is_not_along_the_shaft(self) -> Start:
        shaft, up = unit(self.shaft_direction), unit(self.bend_direction_up)
        if abs(sum(a * b for a, b in zip(shaft, up, strict=True))) > 0.999:
            raise ValueError("bend_direction_up must not point along shaft_direction")
        return self


class Instrument(Section):
    """Shaft and continuum segment."""

    shaft_length_m: Length
    shaft_diameter_m: Length
    segment_length_m: Length
    disk_count: Annotated[int, Field(ge=2, le=64)]
    disk_diameter_m: Length
    tendon_pitch_radius_m: Length
    tendon_diameter_m: Length
    shaft_mass_kg: Positive

    @model_validator(mode="after")
    def _tendons_inside_the_disk(self) -> Instrument:
        if 2 * self.tendon_pitch_radius_m + self.tendon_diameter_m >= self.disk_diameter_m:
            raise ValueError("tendon_pitch_radius_m must leave the tendons inside disk_diameter_m")
        return self


class Module(Section):
    """The instrument module on the flange: where the shaft leaves, pulleys, servos."""

    shaft_base_m: Vector
    shaft_direction: Direction
    bend_direction: Direction
    pulley_radius_m: Length
    servo_ticks_per_turn: Annotated[int, Field(ge=64, le=2**22)]
    servo_range_deg: Annotated[float, Field(gt=0, le=170)]
    servo_speed_deg_s: Annotated[float, Field(gt=0, le=2000)]
    adapter_size_m: tuple[Length, Length]
    mass_kg: Positive
    centre_of_mass_m: Vector

    @model_validator(mode="after")
    def _directions_are_perpendicular(self) -> Module:
        shaft, bend = unit(self.shaft_direction), unit(self.bend_direction)
        if abs(sum(a * b for a, b in zip(shaft, bend, strict=True))) > 1e-9:
            raise ValueError("bend_direction must be perpendicular to shaft_direction")
        return self


class Limits(Section):
    """What the controller never leaves."""

    bend_deg: Annotated[float, Field(gt=0, le=170)]
    lambda_min: Annotated[float, Field(ge=0, lt=1)]
    lambda_max: Annotated[float, Field(gt=0, le=1)]
    joint_speed_rad_s: Annotated[float, Field(gt=0, le=3.14)]
    joint_margin_deg: Annotated[float, Field(ge=0, le=30)]
    approach_gain: Annotated[float, Field(gt=0, le=1)]
    tip_jump_mm: Positive
    tip_jump_deg: Positive
    target_distance_mm: Positive
    tracking_error_rad: Positive
    servo_tracking_error_deg: Positive
    contact_force_n: Positive
    tip_acceleration_mm_s2: Positive
    tip_angular_acceleration_deg_s2: Positive
    workspace_min_m: Vector
    workspace_max_m: Vector
    clearance_mm: Annotated[float, Field(ge=-1000, le=1000)]
    trocar_distance_mm: Positive
    late_tick_ms: Positive

    @model_validator(mode="after")
    def _lambda_interval(self) -> Limits:
        if self.lambda_min >= self.lambda_max:
            raise ValueError("lambda_min must be below lambda_max")
        return self

    @model_validator(mode="after")
    def _workspace_box(self) -> Limits:
        corners = zip(self.workspace_min_m, self.workspace_max_m, strict=True)
        if not all(low < high for low, high in corners):
            raise ValueError("workspace_min_m must be below workspace_max_m on every axis")
        return self


class Commands(Section):
    """Resolved rates, paper eqs. (97)-(101), with the switch read as ``|e| > epsilon * gamma``."""

    feed_forward: bool
    speed_max_mm_s: Annotated[float, Field(gt=0, le=500)]
    speed_min_mm_s: NotNegative
    position_threshold_mm: Positive
    position_ramp: Annotated[float, Field(gt=1)]
    angular_speed_max_deg_s: Annotated[float, Field(gt=0, le=360)]
    angular_speed_min_deg_s: NotNegative
    orientation_threshold_deg: Positive
    orientation_ramp: Annotated[float, Field(gt=1)]
    rcm_gain_per_s: Annotated[float, Field(ge=0, le=1000)]

    @model_validator(mode="after")
    def _slowest_below_fastest(self) -> Commands:
        if self.speed_min_mm_s > self.speed_max_mm_s:
            raise ValueError("speed_min_mm_s must not exceed speed_max_mm_s")
        if self.angular_speed_min_deg_s > self.angular_speed_max_deg_s:
            raise ValueError("angular_speed_min_deg_s must not exceed angular_speed_max_deg_s")
        return self


class Priority(Section):
    """Which command matters most, and what the remaining freedom is used for."""

    case: Literal["0", "1", "2", "pointing"]
    solver: Literal["hqp", "closed-form", "augmented"]
    coordinates: Literal["uv", "polar"]
    characteristic_length_m: Annotated[float, Field(gt=0, le=10)]
    lambda_reference: Annotated[float, Field(gt=0, lt=1)]
    lambda_gain_per_s: NotNegative
    posture_gain_per_s: NotNegative


class Teleoperation(Section):
    """From the leader's motion to the desired tip motion."""

    motion_scale: Positive
    motion_scale_min: Positive
    motion_scale_max: Positive
    alignment: Literal["relative", "matched"]
    alignment_tolerance_deg: Annotated[float, Field(gt=0, le=180)]
    hold_to_move: bool
    gizmo_timeout_ms: Positive
    api_timeout_ms: Positive

    @model_validator(mode="after")
    def _scale_inside_its_range(self) -> Teleoperation:
        if not self.motion_scale_min <= self.motion_scale <= self.motion_scale_max:
            raise ValueError("motion_scale must lie between motion_scale_min and motion_scale_max")
        return self


class Control(Section):
    """The control process."""

    rate_hz: Annotated[float, Field(ge=10, le=2000)]
    realtime: Literal["auto", "off"]
    record_ring_seconds: Annotated[float, Field(ge=1, le=600)]


class Simulation(Section):
    """The simulated robot, and what stands in front of it."""

    plant: Literal["physics", "kinematic"]
    preset: Literal["ideal", "paper", "harsh"]
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)]
    actuation: Literal["servos", "tension-unit"]
    board: Literal["none", "pegboard", "silicon-sine", "silicon-arc", "ring-board"]


class Compensation(Section):
    """How the stretch and friction of the tendons are met."""

    mode: Literal["off", "gain", "full"]


class Tracker(Section):
    """A tracker of the tip's pose, and how much of what it says is taken over."""

    enabled: bool
    rate_hz: Annotated[float, Field(ge=1, le=1000)]
    delay_ms: Annotated[float, Field(ge=0, le=500)]
    position_noise_mm: NotNegative
    orientation_noise_deg: NotNegative
    correction_gain: Annotated[float, Field(gt=0, le=1)]


class Hardware(Section):
    """Which parts of the robot are real. Without a connection all of it is simulated."""

    connected: bool
    arm: Literal["simulated", "locked", "xarm"]
    arm_address: str
    arm_rate_hz: Annotated[float, Field(ge=10, le=250)]


class Servos(Section):
    """The servo bus, its four servos, and how they are homed."""

    port: str
    baud_rate: Literal[9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000]
    ids: tuple[ServoId, ServoId, ServoId, ServoId]
    directions: tuple[Sign, Sign, Sign, Sign]
    rate_hz: Annotated[float, Field(ge=10, le=1000)]
    profile_velocity_deg_s: Annotated[float, Field(gt=0, le=1000)]
    watchdog_ms: Annotated[int, Field(ge=20, le=2540)]
    homing_speed_deg_s: Annotated[float, Field(gt=0, le=90)]
    homing_range_deg: Annotated[float, Field(gt=0, le=170)]
    taut_load_percent: Percent
    pretension_load_percent: Percent
    load_limit_percent: Percent
    temperature_limit_c: Annotated[float, Field(gt=0, le=80)]
    voltage_min_v: Positive
    voltage_max_v: Positive

    @model_validator(mode="after")
    def _consistent(self) -> Servos:
        if len(set(self.ids)) != len(self.ids):
            raise ValueError("ids must differ from each other")
        if not self.taut_load_percent <= self.pretension_load_percent < self.load_limit_percent:
            raise ValueError(
                "taut_load_percent <= pretension_load_percent < load_limit_percent must hold"
            )
        if self.voltage_min_v >= self.voltage_max_v:
            raise ValueError("voltage_min_v must be below voltage_max_v")
        return self


class Stylus(Section):
    """A haptic stylus behind a rosbridge, what its buttons mean, and the force that it renders."""

    source: Literal["off", "rosbridge"]
    url: str
    pose_topic: str
    buttons_topic: str
    force_topic: str
    servo_command_topic: str
    first_button: DriveName
    second_button: DriveName
    both_buttons: DriveName
    timeout_ms: Positive
    force_stiffness_n_m: NotNegative
    force_limit_n: Annotated[float, Field(ge=0, le=3.3)]
    force_source: Literal["spring", "sensed"]
    force_scale: Annotated[float, Field(ge=0, le=10)]
    force_damping_n_s_m: Annotated[float, Field(ge=0, le=20)]
    force_delay_ms: Annotated[float, Field(ge=0, le=200)]
    pose_resolution_mm: Annotated[float, Field(ge=0, le=1)]


class Server(Section):
    """The one public port."""

    host: str
    port: Annotated[int, Field(ge=0, le=65535)]
    lease_seconds: Annotated[float, Field(ge=1, le=600)]
    session_hours: Annotated[float, Field(gt=0, le=8760)]


class Joint(Section):
    """A revolute joint about its own z axis."""

    name: str
    origin_xyz_m: Vector
    origin_rpy_rad: Vector
    lower_rad: Finite
    upper_rad: Finite
    speed_rad_s: Positive
    effort_nm: Positive
    damping_nm_s_rad: NotNegative

    @model_validator(mode="after")
    def _range(self) -> Joint:
        if self.lower_rad >= self.upper_rad:
            raise ValueError("lower_rad must be below upper_rad")
        return self


class Link(Section):
    """Mass properties of a link, in its own frame."""

    name: str
    mass_kg: Positive
    centre_of_mass_m: Vector
    inertia_kg_m2: tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class Arm(Section):
    """The seven joints and eight links (the first is the base)."""

    name: str
    link_radii_m: tuple[Length, Length, Length, Length, Length, Length, Length]
    joints: Annotated[tuple[Joint, ...], Field(min_length=7, max_length=7)]
    links: Annotated[tuple[Link, ...], Field(min_length=8, max_length=8)]


class Configuration(Section):
    """Everything that describes one Keyhole."""

    schema_version: Literal[1]
    robot: RobotName
    trocar: Trocar
    start: Start
    instrument: Instrument
    module: Module
    limits: Limits
    commands: Commands
    priority: Priority
    teleoperation: Teleoperation
    control: Control
    simulation: Simulation
    compensation: Compensation
    tendons: Tendons
    tracker: Tracker
    hardware: Hardware
    servos: Servos
    sensing: Sensing
    tension_unit: TensionUnit
    stylus: Stylus
    server: Server
    arm: Arm
    concentric: Concentric

    @model_validator(mode="after")
    def _start_inside_the_limits(self) -> Configuration:
        if self.start.bend_deg > self.limits.bend_deg:
            raise ValueError("start.bend_deg must not exceed limits.bend_deg")
        if not self.limits.lambda_min < self.start.lambda_along_shaft < self.limits.lambda_max:
            raise ValueError("start.lambda_along_shaft must lie between the lambda limits")
        return self

    @property
    def rate_hz(self) -> float:
        """Rate of the control loop of the robot that this configuration chooses, Hz."""
        return self.concentric.rate_hz if self.robot == "concentric" else self.control.rate_hz

    @property
    def drives_hardware(self) -> bool:
        """Whether parts of the chosen robot are real; concentric-tube arms are always simulated."""
        return self.hardware.connected and self.robot == "instrument"

    def hash64(self) -> int:
        """First 63 bits of the SHA-256 of the canonical JSON: the mark every record carries."""
        digest = hashlib.sha256(self.model_dump_json().encode()).digest()
        return int.from_bytes(digest[:8], "big") >> 1


def parse(table: dict[str, Any], file: str) -> Configuration:
    """Validate what a TOML reader returned.

    Args:
        table: the parsed TOML.
        file: name of the file, for the error message.

    Raises:
        ConfigurationError: names file, key, value and the allowed range of the first wrong value.
    """
    try:
        return Configuration.model_validate(table)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"]) or "(whole file)"
        allowed = first["msg"].removeprefix("Value error, ")
        whole = isinstance(first["input"], dict) or first["type"] == "missing"
        raise ConfigurationError(file, key, None if whole else first["input"], allowed) from None
