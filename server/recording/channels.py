"""The channels beside the records: what people plot, fifty times a second, as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec
import numpy as np

from robot.records import LAMBDA, ErrorSource, LeaderKind, RecordFields, Safety
from robot.safety import REASONS, Event
from robot.sensing.faults import SensingFault
from robot.tension.records import TendonMode
from server.sensed_force import fault_of

RECORDS = "/records"
GAPS = "/gaps"
RATE_HZ = 50.0

_NUMBER: dict[str, Any] = {"type": ["number", "null"]}
_TEXT: dict[str, Any] = {"type": "string"}
_INTEGER: dict[str, Any] = {"type": "integer"}


class JsonChannel(NamedTuple):
    """A topic, the name and JSON schema of its messages, and how one is made of a record."""

    topic: str
    schema_name: str
    schema: dict[str, Any]
    message: Callable[[RecordFields, int], dict[str, Any]]


def _object(title: str, properties: dict[str, Any]) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": properties}


def _numbers(count: int, what: str) -> dict[str, Any]:
    return {
        "type": "array",
        "items": _NUMBER,
        "minItems": count,
        "maxItems": count,
        "description": what,
    }


_TIMESTAMP = _object("time", {"sec": _INTEGER, "nsec": _INTEGER})
_POSE = _object(
    "foxglove.PoseInFrame",
    {
        "timestamp": _TIMESTAMP,
        "frame_id": _TEXT,
        "pose": _object(
            "foxglove.Pose",
            {
                "position": _object("foxglove.Vector3", dict.fromkeys("xyz", _NUMBER)),
                "orientation": _object("foxglove.Quaternion", dict.fromkeys("xyzw", _NUMBER)),
            },
        ),
    },
)


def _timestamp(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // 1_000_000_000, "nsec": time_ns % 1_000_000_000}


def _round(value: float, digits: int = 6) -> float:
    return round(float(value), digits)


def _known(values: np.ndarray, digits: int, known: bool) -> list[float | None]:
    """``values``, or null for each where they are not known."""
    found: list[float | None] = values.round(digits).tolist()
    return found if known else [None] * len(found)


def _pose(time_ns: int, position: np.ndarray, wxyz: np.ndarray) -> dict[str, Any]:
    x, y, z = position.tolist()
    w, qx, qy, qz = wxyz.tolist()
    return {
        "timestamp": _timestamp(time_ns),
        "frame_id": "base",
        "pose": {
            "position": {"x": x, "y": y, "z": z},
            "orientation": {"x": qx, "y": qy, "z": qz, "w": w},
        },
    }


def _desired(record: RecordFields, time_ns: int) -> dict[str, Any]:
    report = record["outcome"]["report"]
    return _pose(time_ns, report["desired_position"], report["desired_wxyz"])


def _commanded(record: RecordFields, time_ns: int) -> dict[str, Any]:
    report = record["outcome"]["report"]
    return _pose(time_ns, report["commanded_position"], report["commanded_wxyz"])


def _true(record: RecordFields, time_ns: int) -> dict[str, Any]:
    return _pose(time_ns, record["truth"]["position"], record["truth"]["wxyz"])


def _errors(record: RecordFields, _: int) -> dict[str, Any]:
    truth = record["truth"]
    return {
        "position_mm": _round(truth["position_error"] * 1e3),
        "orientation_deg": _round(math.degrees(truth["orientation_error"])),
        "rcm_mm": _round(truth["rcm_error"] * 1e3),
        "source": ErrorSource(int(truth["source"])).name.lower(),
    }


def _joints(record: RecordFields, _: int) -> dict[str, Any]:
    report, command = record["outcome"]["report"], record["outcome"]["command"]
    measured = record["input"]
    return {
        "commanded_deg": np.rad2deg(report["x"][:7]).round(5).tolist(),
        "measured_deg": np.rad2deg(measured["measured_q"]).round(5).tolist(),
        "servo_commanded_deg": np.rad2deg(command["servo"]).round(5).tolist(),
        "servo_measured_deg": np.rad2deg(measured["measured_servo"]).round(5).tolist(),
        "bend_deg": _round(90.0 - math.degrees(report["theta"])),
        "direction_deg": _round(math.degrees(report["delta"])),
        "lambda": _round(report["x"][LAMBDA]),
    }


def _relative_errors(record: RecordFields, _: int) -> dict[str, Any]:
    truth = record["truth"]
    return {
        "position_mm": _round(truth["position_error"] * 1e3),
        "relative_mm": _round(truth["relative_error"] * 1e3),
        "source": ErrorSource(int(truth["source"])).name.lower(),
    }


def _true_b(record: RecordFields, time_ns: int) -> dict[str, Any]:
    return _pose(time_ns, record["truth"]["position_b"], record["truth"]["wxyz_b"])


def _tubes(record: RecordFields, _: int) -> dict[str, Any]:
    report, measured = record["outcome"]["report"], record["input"]["measured_q"]
    commanded = report["q"].reshape(2, 2, -1)
    there = measured.reshape(2, 2, -1)
    message: dict[str, Any] = {}
    for arm, name in enumerate("ab"):
        message[f"translation_commanded_{name}_mm"] = (commanded[arm, 0] * 1e3).round(6).tolist()
        message[f"translation_measured_{name}_mm"] = (there[arm, 0] * 1e3).round(6).tolist()
        message[f"rotation_commanded_{name}_deg"] = np.rad2deg(commanded[arm, 1]).round(5).tolist()
        message[f"rotation_measured_{name}_deg"] = np.rad2deg(there[arm, 1]).round(5).tolist()
        message[f"stability_{name}"] = _round(report["stability"][arm])
    return message


def _forces(record: RecordFields, _: int) -> dict[str, Any]:
    measured, command = record["input"], record["outcome"]["command"]
    held = command["tendon_mode"] == TendonMode.TENSION
    return {
        "tension_n": _known(measured["measured_tension"], 5, bool(measured["tension_cells"])),
        "tension_wanted_n": _known(np.where(held, command["tension"], np.nan), 5, True),
        "contact_n": _round(measured["measured_contact"]),
    }


def _sensing(record: RecordFields, _: int) -> dict[str, Any]:
    report, fault = record["outcome"]["report"], fault_of(record["outcome"]["report"])
    valid = fault == SensingFault.NONE
    simulated = record["truth"]["source"] == ErrorSource.TRUE
    return {
        "valid": valid,
        "fault": fault.name.lower(),
        "force_n": _known(report["estimate_force"], 5, valid),
        "force_covariance_n2": _known(report["estimate_force_covariance"].ravel(), 9, valid),
        "tension_n": _known(report["estimate_tension"], 5, valid),
        "curvature_modes": _known(report["estimate_modes"], 6, valid),
        "true_force_n": _known(record["truth"]["contact_wrench"][:3], 5, simulated),
    }


def _estimated(record: RecordFields, time_ns: int) -> dict[str, Any]:
    report = record["outcome"]["report"]
    position, wxyz = report["estimate_position"], report["estimate_wxyz"]
    if fault_of(report) != SensingFault.NONE:
        position, wxyz = np.full(3, np.nan), np.full(4, np.nan)
    return _pose(time_ns, position, wxyz)


def _safety(record: RecordFields, _: int) -> dict[str, Any]:
    state, report = record["outcome"]["state"], record["outcome"]["report"]
    return {
        "state": Safety(int(state["safety"])).name,
        "reason": REASONS[Event(int(state["reason"]))][0],
        "engaged": bool(state["engaged"]),
        "leader": LeaderKind(int(state["leader_kind"])).name.lower(),
        "limits": int(report["limits_active"]),
    }


_ERRORS_SCHEMA = _object(
    "keyhole.Errors",
    {
        "position_mm": _NUMBER,
        "orientation_deg": _NUMBER,
        "rcm_mm": _NUMBER,
        "source": {**_TEXT, "description": "errors are desired minus true, or minus measured"},
    },
)
_RELATIVE_ERRORS_SCHEMA = _object(
    "keyhole.RelativeErrors",
    {
        "position_mm": {**_NUMBER, "description": "of A's tip"},
        "relative_mm": {**_NUMBER, "description": "of B's tip from its place beside A's"},
        "source": {**_TEXT, "description": "errors are desired minus true, or minus measured"},
    },
)
_EACH_TUBE: dict[str, Any] = {"type": "array", "items": _NUMBER}
_TUBES_SCHEMA = _object(
    "keyhole.Tubes",
    {
        f"{name}_{arm}{unit}": schema
        for arm in "ab"
        for name, unit, schema in (
            ("translation_commanded", "_mm", _EACH_TUBE),
            ("translation_measured", "_mm", _EACH_TUBE),
            ("rotation_commanded", "_deg", _EACH_TUBE),
            ("rotation_measured", "_deg", _EACH_TUBE),
            ("stability", "", {**_NUMBER, "description": "1 far from snapping, 0 where it snaps"}),
        )
    },
)
_JOINTS_SCHEMA = _object(
    "keyhole.Joints",
    {
        "commanded_deg": _numbers(7, "joints as commanded, deg"),
        "measured_deg": _numbers(7, "joints as measured, deg"),
        "servo_commanded_deg": _numbers(4, "tendon servos as commanded, deg"),
        "servo_measured_deg": _numbers(4, "tendon servos as measured, deg"),
        "bend_deg": {**_NUMBER, "description": "bend of the segment, 0 when straight"},
        "direction_deg": {**_NUMBER, "description": "direction of the bend"},
        "lambda": {**_NUMBER, "description": "place of the trocar along the shaft, 0 to 1"},
    },
)
_FORCES_SCHEMA = _object(
    "keyhole.Forces",
    {
        "tension_n": _numbers(4, "measured tendon tensions, N; null where nothing measures it"),
        "tension_wanted_n": _numbers(4, "tensions that drives are told to hold, N; null: a length"),
        "contact_n": {**_NUMBER, "description": "largest contact force on the instrument, N"},
    },
)
_SENSING_SCHEMA = _object(
    "keyhole.Sensing",
    {
        "valid": {"type": "boolean"},
        "fault": {**_TEXT, "description": "why there is no estimate; none while it is valid"},
        "force_n": _numbers(3, "of the environment on the tip, base frame, N"),
        "force_covariance_n2": _numbers(9, "of it, row by row, N^2"),
        "tension_n": _numbers(4, "tendon tensions as estimated, N"),
        "curvature_modes": _numbers(11, "of the segment, from the shaft's end on, rad"),
        "true_force_n": _numbers(3, "of all contacts together, simulation only, N"),
    },
)
_SAFETY_SCHEMA = _object(
    "keyhole.Safety",
    {
        "state": {"enum": [state.name for state in Safety]},
        "reason": _TEXT,
        "engaged": {"type": "boolean"},
        "leader": _TEXT,
        "limits": {**_INTEGER, "description": "bits of the limits that hold the motion back"},
    },
)

_SHARED_CHANNELS = (
    JsonChannel("/tip/desired", "foxglove.PoseInFrame", _POSE, _desired),
    JsonChannel("/tip/commanded", "foxglove.PoseInFrame", _POSE, _commanded),
    JsonChannel("/tip/true", "foxglove.PoseInFrame", _POSE, _true),
    JsonChannel("/safety", "keyhole.Safety", _SAFETY_SCHEMA, _safety),
)

_OWN_CHANNELS = {
    "instrument": (
        JsonChannel("/errors", "keyhole.Errors", _ERRORS_SCHEMA, _errors),
        JsonChannel("/joints", "keyhole.Joints", _JOINTS_SCHEMA, _joints),
        JsonChannel("/forces", "keyhole.Forces", _FORCES_SCHEMA, _forces),
        JsonChannel("/sensing", "keyhole.Sensing", _SENSING_SCHEMA, _sensing),
        JsonChannel("/tip/estimated", "foxglove.PoseInFrame", _POSE, _estimated),
    ),
    "concentric": (
        JsonChannel("/errors", "keyhole.RelativeErrors", _RELATIVE_ERRORS_SCHEMA, _relative_errors),
        JsonChannel("/tip/b", "foxglove.PoseInFrame", _POSE, _true_b),
        JsonChannel("/tubes", "keyhole.Tubes", _TUBES_SCHEMA, _tubes),
    ),
}


def json_channels(robot: str) -> tuple[JsonChannel, ...]:
    """The channels of the robot of that name."""
    return _OWN_CHANNELS[robot] + _SHARED_CHANNELS


GAP_SCHEMA = _object(
    "keyhole.Gap",
    {
        "missing": {**_INTEGER, "description": "how many records were lost before the next one"},
        "next_sequence": {**_INTEGER, "description": "number of the next record"},
    },
)


def schema_bytes(schema: dict[str, Any]) -> bytes:
    """A JSON schema as the file holds it."""
    return json.dumps(schema).encode()


def message_bytes(message: dict[str, Any]) -> bytes:
    """A message as the file holds it; what is not a number (NaN) becomes null."""
    return msgspec.json.encode(message)
