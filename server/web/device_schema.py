"""Devices, readiness and clearance as schemas, for the API's documentation and for the tests."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

DeviceWord = Literal["simulated", "searching", "preparing", "connected", "homing", "fault"]


class DevicePart(BaseModel):
    """A part of the devices; numbers are null where they are not known."""

    model_config = ConfigDict(extra="forbid")


class ServoPart(DevicePart):
    """One servo."""

    id: int | None
    answers: bool
    torque: bool
    firmware: int | None
    position_deg: float | None = Field(description="From the straight segment.")
    load_percent: float | None = Field(description="Of its largest load, -100 to 100.")
    voltage_v: float | None
    temperature_c: float | None
    age_ms: float | None
    error: str | None = Field(description="What it reports, and what to do.")


class BusPart(DevicePart):
    """The servo bus of the instrument module."""

    state: DeviceWord
    port: str
    message: str
    homed: bool
    homing_progress: float | None = Field(description="0 to 1.")
    baud_rate: int | None
    rate_hz: float | None = Field(description="Cycles of write and read-back per second.")
    cycle_median_ms: float | None
    cycle_p99_ms: float | None
    cpu_percent: float | None = Field(description="Of one core, taken by the bus' thread.")
    cycles: int | None
    missed: int | None = Field(description="Cycles in which a servo did not answer.")
    bad_packets: int | None
    reconnects: int | None
    servos: list[ServoPart]


class ArmPart(DevicePart):
    """The arm that carries the module."""

    kind: str = Field(description="simulated, locked or xarm.")
    state: DeviceWord
    address: str
    message: str
    error: int | None = Field(description="Code of its controller; 0 for none.")
    warning: int | None
    rate_hz: float | None
    age_ms: float | None
    reconnects: int | None


class DevicesPart(DevicePart):
    """Everything with a wire."""

    simulated: bool = Field(description="Whether all of the robot is simulated.")
    bus: BusPart | None = Field(description="Null where there is none.")
    arm: ArmPart | None = Field(description="Null where nothing is told of it.")


class ReadinessPart(DevicePart):
    """Whether the devices could be enabled, why not, and what to do."""

    state: Literal[
        "ready",
        "not_connected",
        "not_homed",
        "busy",
        "torque_off",
        "device_fault",
        "outside_limits",
    ]
    reason: str
    action: str


class ClearancePart(DevicePart):
    """How near arm, module, shaft and body wall are to each other, as measured."""

    distance_mm: float | None
    between: str | None = Field(description="Which two are nearest.")
    limit_mm: float | None = Field(description="Nearer than this pauses the motion.")
