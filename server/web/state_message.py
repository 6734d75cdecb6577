"""From a record to the JSON message that the API, the stream and the page speak. Pure.

SI becomes millimetres and degrees here, with the unit in the name. A number that is not known (NaN,
or no record yet) is null.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.devices import DEVICES
from robot.configuration import Configuration
from robot.parameters import parameters
from robot.priority.levels import CASE_NAMES
from robot.priority.limits import describe
from robot.records import (
    LAMBDA,
    RECORD,
    Alignment,
    Case,
    Compensation,
    Coordinates,
    ErrorSource,
    LeaderKind,
    Refusal,
    Safety,
    Solver,
)
from robot.safety import REASONS, Event
from scenes.boards.board import BOARD_NAMES, board
from scenes.trocar_motion import STILL, Breathing
from server.memory.replay_link import ReplayStatus
from server.web.devices_view import clearance_view, devices_view, readiness_view

MESSAGE_SCHEMA_VERSION = 1

CASES = {case: name for name, case in CASE_NAMES.items()}
SOLVERS = {solver: solver.name.lower().replace("_", "-") for solver in Solver}
COORDINATES = {coordinates: coordinates.name.lower() for coordinates in Coordinates}
ALIGNMENTS = {alignment: alignment.name.lower() for alignment in Alignment}
COMPENSATIONS = {mode: mode.name.lower() for mode in Compensation}

_REFUSED: dict[Refusal, tuple[str, str]] = {
    Refusal.TARGET_TOO_FAR: ("the target is too far from the tip", "choose a nearer target"),
    Refusal.NOT_ALIGNED: (
        "the leader does not point as the tip does",
        "turn the leader, or choose relative alignment",
    ),
    Refusal.HOLD_NOT_PRESSED: ("hold-to-move is not pressed", "hold it while moving"),
    Refusal.OUTSIDE_WORKSPACE: (
        "the target is outside of the workspace; the tip stays at its border",
        "move back inside",
    ),
    Refusal.BEHIND_TROCAR: (
        "the target is behind the trocar; the tip stays under the body wall",
        "aim under the body wall",
    ),
}


@dataclass(frozen=True)
class Surroundings:
    """What a state message tells beside the record.

    Attributes:
        now_ns: the host's monotonic clock.
        control: ``running``, ``starting`` or ``down``.
        control_words: why control does not run, empty when it does.
        plant: name of the plant.
        board: name of the board before the instrument.
        trocar_source: how the trocar came to be where it is taken to be.
        breathing: how it was last asked to breathe.
        realtime: scheduling of the control process, in words.
        path_name: name of the path that plays, if one does.
        rate_hz: measured rate of the loop, None while it is not known.
        real_time_factor: plant time over host time, None while it is not known.
        devices: (1,) DEVICES, what the plant told of its devices last.
        recording: whether records are being written down.
        replay: what is shown of a recording; None where there is a robot.
    """

    now_ns: int
    control: str
    control_words: str = ""
    plant: str = ""
    board: str = "none"
    trocar_source: str = "configuration"
    breathing: Breathing = STILL
    realtime: str = ""
    path_name: str | None = None
    rate_hz: float | None = None
    real_time_factor: float | None = None
    devices: NDArray[Any] = field(default_factory=lambda: np.zeros(1, DEVICES))
    recording: bool = False
    replay: ReplayStatus | None = None


@dataclass(frozen=True)
class OperatorView:
    """Who drives, as one reader of the message sees it."""

    name: str | None = None
    you: bool = False
    expires_in_s: float | None = None
    offered_to: str | None = None
    asked_by: str | None = None


def _round(value: float, digits: int) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None


def _each(values: NDArray[Any], digits: int) -> list[float | None]:
    return [_round(value, digits) for value in values.tolist()]


def _millimetres(position: NDArray[Any]) -> list[float | None]:
    return _each(position * 1e3, 6)


def _degrees(angles: NDArray[Any]) -> list[float | None]:
    return _each(np.rad2deg(angles), 5)


def _pose(position: NDArray[Any], wxyz: NDArray[Any]) -> dict[str, Any]:
    return {"position_mm": _millimetres(position), "orientation_wxyz": _each(wxyz, 9)}


def _nulled(value: object) -> Any:
    """``value`` with every number in it replaced by null."""
    if isinstance(value, dict):
        return {key: _nulled(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_nulled(part) for part in value]
    return None if isinstance(value, int | float) and not isinstance(value, bool) else value


class StateMessages:
    """Makes state messages for one configuration.

    Args:
        configuration: of the robot whose records come.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._parameters = parameters(configuration)
        self._teleoperation = configuration.teleoperation
        self._limits = configuration.limits
        self._simulation = configuration.simulation
        self._configuration = configuration
        self._boards: dict[str, tuple[int, bool]] = {}
        lower, upper = self._parameters["joint_lower"][0], self._parameters["joint_upper"][0]
        self._joint_limits = [
            list(pair) for pair in zip(_degrees(lower), _degrees(upper), strict=True)
        ]

        self._unknown = np.zeros(1, RECORD)
        self._set_configured(self._unknown["input"]["settings"], configuration)

    @staticmethod
    def _set_configured(settings: NDArray[Any], configuration: Configuration) -> None:
        """What will be in force when control starts, so that the page shows no false choice."""
        priority, teleoperation = configuration.priority, configuration.teleoperation
        settings["case"] = CASE_NAMES[priority.case]
        settings["solver"] = next(s for s, name in SOLVERS.items() if name == priority.solver)
        settings["coordinates"] = Coordinates[priority.coordinates.upper()]
        settings["alignment"] = Alignment[teleoperation.alignment.upper()]
        settings["hold_to_move"] = teleoperation.hold_to_move
        settings["motion_scale"] = teleoperation.motion_scale
        settings["compensation"] = Compensation[configuration.compensation.mode.upper()]
        settings["use_tracker"] = configuration.tracker.enabled

    def load_boards(self) -> None:
        """Find out about every board."""
        for name in BOARD_NAMES:
            self._board(name)

    def _board(self, name: str) -> tuple[int, bool]:
        """How many rings the board of that name has, and whether it has a ball."""
        if name not in BOARD_NAMES:
            return 0, False
        if name not in self._boards:
            found = board(name, self._configuration)
            self._boards[name] = len(found.rings), found.ball is not None
        return self._boards[name]

    def message(
        self, record: NDArray[Any] | None, around: Surroundings, operator: OperatorView
    ) -> dict[str, Any]:
        """The state message.

        Args:
            record: (1,) RECORD, or None before control has published one.
            around: what is known beside the record.
            operator: who drives, seen by the reader.
        """
        known = self._unknown if record is None else record
        body = self._body(known[0], around)
        if record is None:
            configured = ("priority", "teleoperation", "bend_limit_deg", "joint_limits_deg",
                          "compensation", "tracker")  # fmt: skip
            body = {**_nulled(body), **{name: body[name] for name in configured}}
        return {
            "type": "state",
            "schema_version": MESSAGE_SCHEMA_VERSION,
            "robot": "instrument",
            **body,
            "safety": _safety(known[0], around),
            "operator": {
                "name": operator.name,
                "you": operator.you,
                "expires_in_s": None
                if operator.expires_in_s is None
                else round(operator.expires_in_s, 2),
                "offered_to": operator.offered_to,
                "asked_by": operator.asked_by,
            },
            "plant": around.plant,
            **self._robot_of(around),
            "readiness": readiness_view(int(known[0]["input"]["readiness"])),
            "devices": devices_view(around.devices, self._configuration.hardware.connected),
            "recording": around.recording,
            "replay": None if around.replay is None else replay_view(around.replay),
            "control": around.control,
        }

    def _body(self, record: np.void, around: Surroundings) -> dict[str, Any]:
        header, tick_input, truth = record["header"], record["input"], record["truth"]
        state, report = record["outcome"]["state"], record["outcome"]["report"]
        return {
            "tick": int(header["tick"]),
            "time_s": _round(header["time_ns"] * 1e-9, 6),
            "age_ms": _round(max(0, around.now_ns - int(header["stamp_ns"])) * 1e-6, 3),
            "engaged": bool(state["engaged"]),
            "leader": LeaderKind(int(state["leader_kind"])).name.lower(),
            "hold": bool(tick_input["hold"]),
            "priority": _priority(tick_input["settings"]),
            "teleoperation": self._teleoperation_of(tick_input["settings"]),
            "errors": {
                "position_mm": _round(truth["position_error"] * 1e3, 6),
                "orientation_deg": _round(math.degrees(truth["orientation_error"]), 6),
                "rcm_mm": _round(truth["rcm_error"] * 1e3, 6),
                "source": ErrorSource(int(truth["source"])).name.lower(),
            },
            **self._configuration_of(record),
            "desired": _pose(report["desired_position"], report["desired_wxyz"]),
            "commanded": _pose(report["commanded_position"], report["commanded_wxyz"]),
            "true": _pose(truth["position"], truth["wxyz"]),
            "trocar_mm": _millimetres(tick_input["trocar_position"]),
            "trocar": _trocar(around),
            "clearance": clearance_view(state, self._limits.clearance_mm * 1e-3),
            "compensation": COMPENSATIONS[
                Compensation(int(tick_input["settings"]["compensation"]))
            ],
            "tracker": _tracker(tick_input, state),
            "tension_n": _each(tick_input["measured_tension"], 3),
            **self._touched(record, around.board),
            "residuals": {
                "rcm_mm_s": _round(report["residual_rcm"] * 1e3, 4),
                "linear_mm_s": _round(report["residual_linear"] * 1e3, 4),
                "angular_deg_s": _round(math.degrees(report["residual_angular"]), 4),
            },
            "limits": describe(int(report["limits_active"]), report["x"], self._parameters),
            "loop": _loop(header, around),
            "path": _path(header, around),
        }

    def _robot_of(self, around: Surroundings) -> dict[str, Any]:
        """Which of the simulated robots it is."""
        physics = around.plant == "physics"
        return {
            "preset": self._simulation.preset if physics else None,
            "seed": self._simulation.seed if physics else None,
            "board": around.board,
        }

    def _touched(self, record: np.void, name: str) -> dict[str, Any]:
        """Contact, and what has been done on the board of that name."""
        truth, tick_input = record["truth"], record["input"]
        allowed = max(self._limits.contact_force_n, record["outcome"]["state"]["contact_allowance"])
        rings, has_ball = self._board(name)
        return {
            "contact": {
                "count": int(truth["contact_count"]),
                "force_n": _round(tick_input["measured_contact"], 4),
                "limit_n": _round(allowed, 4),
            },
            "rings": {
                "passed": int(truth["rings_passed"]).bit_count(),
                "touched": int(truth["rings_touched"]).bit_count(),
                "total": rings,
            }
            if rings
            else None,
            "ball": {"progress": _round(truth["ball_progress"], 4)} if has_ball else None,
        }

    def _teleoperation_of(self, settings: np.void) -> dict[str, Any]:
        return {
            "motion_scale": _round(settings["motion_scale"], 6),
            "motion_scale_min": self._teleoperation.motion_scale_min,
            "motion_scale_max": self._teleoperation.motion_scale_max,
            "lock_rotation": bool(settings["lock_rotation"]),
            "lock_translation": bool(settings["lock_translation"]),
            "alignment": ALIGNMENTS[Alignment(int(settings["alignment"]))],
            "hold_to_move": bool(settings["hold_to_move"]),
        }

    def _configuration_of(self, record: np.void) -> dict[str, Any]:
        """Joints, bend and lambda as commanded, with their limits."""
        command, report = record["outcome"]["command"], record["outcome"]["report"]
        x = report["x"]
        return {
            "lambda": {
                "value": _round(x[LAMBDA], 6),
                "reference": _round(record["input"]["settings"]["lambda_reference"], 6),
                "min": self._limits.lambda_min,
                "max": self._limits.lambda_max,
            },
            "bend_deg": _round(90.0 - math.degrees(report["theta"]), 5),
            "bend_limit_deg": self._limits.bend_deg,
            "direction_deg": _round(math.degrees(report["delta"]), 5),
            "joints_deg": _degrees(x[:7]),
            "joint_limits_deg": self._joint_limits,
            "servos_deg": _degrees(command["servo"]),
        }


def _safety(record: np.void, around: Surroundings) -> dict[str, str]:
    state = record["outcome"]["state"]
    event = Event(int(state["reason"]))
    reason, action = REASONS[event]
    code = "ready" if event == Event.ENABLE else event.name.lower()
    refused = Refusal(int(record["outcome"]["report"]["target_refused"]))
    if refused != Refusal.NONE and state["safety"] == Safety.ENABLED:
        (reason, action), code = _REFUSED[refused], refused.name.lower()
    if around.control != "running":
        code = f"control_{around.control}"
        reason = around.control_words or f"control is {around.control}"
        action = "wait; if it does not come back, read what keyhole printed"
    return {
        "state": Safety(int(state["safety"])).name,
        "reason": reason,
        "reason_code": code,
        "action": action,
    }


def replay_view(status: ReplayStatus) -> dict[str, Any]:
    """What is shown of a recording, as the message tells it."""
    return {
        "file": status.path.name,
        "time_s": round(status.time_s, 3),
        "duration_s": round(status.duration_s, 3),
        "playing": status.playing,
        "speed": status.speed,
        "started": datetime.fromtimestamp(status.started_ns * 1e-9, UTC).isoformat("T", "seconds"),
        "cut": status.cut,
    }


def _trocar(around: Surroundings) -> dict[str, Any]:
    breathing = around.breathing
    return {
        "method": around.trocar_source,
        "breathing_amplitude_mm": _round(breathing.amplitude_m * 1e3, 6),
        "breathing_period_s": _round(breathing.period_s, 6),
    }


def _tracker(tick_input: np.void, state: np.void) -> dict[str, Any]:
    """Whether the tracker is listened to, and by how much the tip is corrected for it."""
    position, rotation = state["correction_position"], state["correction_rotation"]
    seen = tick_input["tracker"]["sequence"] > 0
    return {
        "on": bool(tick_input["settings"]["use_tracker"]),
        "age_ms": _round(tick_input["tracker"]["age_s"] * 1e3, 3) if seen else None,
        "correction_mm": _round(float(np.linalg.norm(position)) * 1e3, 4),
        "correction_deg": _round(math.degrees(float(np.linalg.norm(rotation))), 4),
    }


def _priority(settings: np.void) -> dict[str, str]:
    return {
        "case": CASES[Case(int(settings["case"]))],
        "solver": SOLVERS[Solver(int(settings["solver"]))],
        "coordinates": COORDINATES[Coordinates(int(settings["coordinates"]))],
    }


def _loop(header: np.void, around: Surroundings) -> dict[str, Any]:
    return {
        "rate_hz": None if around.rate_hz is None else _round(around.rate_hz, 1),
        "overruns": int(header["overruns"]),
        "lateness_us": _round(header["lateness_ns"] * 1e-3, 1),
        "tick_us": _round(header["tick_ns"] * 1e-3, 1),
        "realtime": around.realtime,
        "real_time_factor": None
        if around.real_time_factor is None
        else _round(around.real_time_factor, 4),
    }


def _path(header: np.void, around: Surroundings) -> dict[str, Any] | None:
    if header["path_id"] == 0:
        return None
    return {"name": around.path_name, "progress": _round(float(header["path_progress"]), 4)}
