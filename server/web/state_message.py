"""From a record to the JSON message that the API, the stream and the page speak. Pure.

SI becomes millimetres and degrees here, with the unit in the name. A number that is not known (NaN,
or no record yet) is null. What only one robot has is added by a class of its own.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.devices import DEVICES
from robot.configuration import Configuration
from robot.record_types import record_types_of
from robot.records import Alignment, ErrorSource, LeaderKind, Refusal, Safety
from robot.safety import REASONS, Event
from scenes.trocar_motion import STILL, Breathing
from server.memory.replay_link import ReplayStatus
from server.web.devices_view import devices_view, readiness_view

MESSAGE_SCHEMA_VERSION = 1

DRAWN_PLANTS = ("physics", "tubes")
"""Plants of which preset and seed draw one."""

ALIGNMENTS = {alignment: alignment.name.lower() for alignment in Alignment}

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


def rounded(value: float, digits: int) -> float | None:
    """``value`` with so many digits; None where it is no number."""
    return round(float(value), digits) if math.isfinite(value) else None


def each(values: NDArray[Any], digits: int) -> list[float | None]:
    """Each of ``values``, as :func:`rounded` gives it."""
    return [rounded(value, digits) for value in values.tolist()]


def millimetres(position: NDArray[Any]) -> list[float | None]:
    """Metres in mm."""
    return each(position * 1e3, 6)


def degrees(angles: NDArray[Any]) -> list[float | None]:
    """Radians in degrees."""
    return each(np.rad2deg(angles), 5)


def pose(position: NDArray[Any], wxyz: NDArray[Any]) -> dict[str, Any]:
    """A pose in mm and as a quaternion."""
    return {"position_mm": millimetres(position), "orientation_wxyz": each(wxyz, 9)}


def _nulled(value: object) -> Any:
    """``value`` with every number in it replaced by null."""
    if isinstance(value, dict):
        return {key: _nulled(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_nulled(part) for part in value]
    return None if isinstance(value, int | float) and not isinstance(value, bool) else value


class StateMessages(ABC):
    """Makes state messages for one configuration.

    Args:
        configuration: of the robot whose records come.
    """

    CONFIGURED: tuple[str, ...] = ("teleoperation",)
    """What the message tells before the first record, so that the page shows no false choice."""

    REFUSED: dict[Refusal, tuple[str, str]] = _REFUSED
    """Why a leader is not followed, and what to do."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._teleoperation = configuration.teleoperation
        self._unknown = np.zeros(1, record_types_of(configuration).record)
        settings = self._unknown["input"]["settings"]
        settings["alignment"] = Alignment[self._teleoperation.alignment.upper()]
        settings["hold_to_move"] = self._teleoperation.hold_to_move
        settings["motion_scale"] = self._teleoperation.motion_scale
        self._set_configured(settings)

    @abstractmethod
    def _set_configured(self, settings: NDArray[Any]) -> None:
        """What will be in force when control starts, of this robot's own choices."""

    @abstractmethod
    def _own(self, record: np.void, around: Surroundings) -> dict[str, Any]:
        """What only this robot has."""

    @abstractmethod
    def load(self) -> None:
        """Find out about what the first message would wait for."""

    def message(
        self, record: NDArray[Any] | None, around: Surroundings, operator: OperatorView
    ) -> dict[str, Any]:
        """The state message.

        Args:
            record: (1,) record of the robot, or None before control has published one.
            around: what is known beside the record.
            operator: who drives, seen by the reader.
        """
        known = self._unknown if record is None else record
        body = self._shared(known[0], around) | self._own(known[0], around)
        if record is None:
            body = {**_nulled(body), **{name: body[name] for name in self.CONFIGURED}}
        return {
            "type": "state",
            "schema_version": MESSAGE_SCHEMA_VERSION,
            "robot": self._configuration.robot,
            **body,
            "safety": self._safety(known[0], around),
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
            **self._which(around),
            "readiness": readiness_view(int(known[0]["input"]["readiness"])),
            "devices": devices_view(around.devices, self._configuration.drives_hardware),
            "recording": around.recording,
            "replay": None if around.replay is None else replay_view(around.replay),
            "control": around.control,
        }

    def _shared(self, record: np.void, around: Surroundings) -> dict[str, Any]:
        header, tick_input, truth = record["header"], record["input"], record["truth"]
        state, report = record["outcome"]["state"], record["outcome"]["report"]
        return {
            "tick": int(header["tick"]),
            "time_s": rounded(header["time_ns"] * 1e-9, 6),
            "age_ms": rounded(max(0, around.now_ns - int(header["stamp_ns"])) * 1e-6, 3),
            "engaged": bool(state["engaged"]),
            "leader": LeaderKind(int(state["leader_kind"])).name.lower(),
            "hold": bool(tick_input["hold"]),
            "teleoperation": self._teleoperation_of(tick_input["settings"]),
            "desired": pose(report["desired_position"], report["desired_wxyz"]),
            "commanded": pose(report["commanded_position"], report["commanded_wxyz"]),
            "true": pose(truth["position"], truth["wxyz"]),
            "loop": _loop(header, around),
            "path": _path(header, around),
        }

    def _safety(self, record: np.void, around: Surroundings) -> dict[str, str]:
        state = record["outcome"]["state"]
        event = Event(int(state["reason"]))
        reason, action = REASONS[event]
        code = "ready" if event == Event.ENABLE else event.name.lower()
        refused = Refusal(int(record["outcome"]["report"]["target_refused"]))
        if refused != Refusal.NONE and state["safety"] == Safety.ENABLED:
            (reason, action), code = self.REFUSED[refused], refused.name.lower()
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

    def _which(self, around: Surroundings) -> dict[str, Any]:
        """Which of the simulated robots it is; only those that differ have a preset and a seed."""
        simulation, differs = self._configuration.simulation, around.plant in DRAWN_PLANTS
        return {
            "preset": simulation.preset if differs else None,
            "seed": simulation.seed if differs else None,
        }

    def _teleoperation_of(self, settings: np.void) -> dict[str, Any]:
        return {
            "motion_scale": rounded(settings["motion_scale"], 6),
            "motion_scale_min": self._teleoperation.motion_scale_min,
            "motion_scale_max": self._teleoperation.motion_scale_max,
            "lock_rotation": bool(settings["lock_rotation"]),
            "lock_translation": bool(settings["lock_translation"]),
            "alignment": ALIGNMENTS[Alignment(int(settings["alignment"]))],
            "hold_to_move": bool(settings["hold_to_move"]),
        }


def error_source(truth: np.void) -> str:
    """What the errors are measured against."""
    return ErrorSource(int(truth["source"])).name.lower()


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


def _loop(header: np.void, around: Surroundings) -> dict[str, Any]:
    return {
        "rate_hz": None if around.rate_hz is None else rounded(around.rate_hz, 1),
        "overruns": int(header["overruns"]),
        "lateness_us": rounded(header["lateness_ns"] * 1e-3, 1),
        "tick_us": rounded(header["tick_ns"] * 1e-3, 1),
        "realtime": around.realtime,
        "real_time_factor": None
        if around.real_time_factor is None
        else rounded(around.real_time_factor, 4),
    }


def _path(header: np.void, around: Surroundings) -> dict[str, Any] | None:
    if header["path_id"] == 0:
        return None
    return {"name": around.path_name, "progress": rounded(float(header["path_progress"]), 4)}
