"""The leaders of the API: a standing target, and the clutched pose of an outside device."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import LeaderKind, Refusal, Safety
from server.memory.link import WebLink
from server.web.control_requests import check_enabled, safety_of
from server.web.refusals import NotReady, TargetTooFar
from server.web.state_source import StateSource

REPEAT_S = 0.1
_TARGET_TIMEOUT_S = 0.5
_ANSWER_S = 0.2
_POLL_S = 0.001
_SETTLED_S = 0.3
_STILL_MM_S = 0.05
_STILL_DEG_S = 0.05


@dataclass(frozen=True)
class Target:
    """A tip pose to go to: position (3,) in m and quaternion (4,), base frame."""

    sequence: int
    position: NDArray[np.float64]
    wxyz: NDArray[np.float64]


class TargetLeader:
    """Keeps a target pose standing until the tip has come to rest, or anything else intervenes.

    The target is repeated while the operator is there: if this process ends, control sees a stale
    leader and pauses. Belongs to the event loop.

    Args:
        link: to the control process.
        source: of the newest record.
        configuration: how far a target may be.
    """

    def __init__(self, link: WebLink, source: StateSource, configuration: Configuration) -> None:
        self._link, self._source = link, source
        self._farthest_mm = configuration.limits.target_distance_mm
        self._target: Target | None = None
        self._next_sequence = time.monotonic_ns()
        self._still_since: float | None = None

    async def set(
        self, position: NDArray[np.float64], wxyz: NDArray[np.float64] | None
    ) -> NDArray[Any]:
        """Make the tip go to a pose.

        Args:
            position: (3,) in m, base frame.
            wxyz: (4,) quaternion, base frame; None keeps the desired orientation.

        Returns:
            The (1,) record in which control follows it.

        Raises:
            NotReady: the robot is not enabled, or something else leads it.
            TargetTooFar: further from the commanded tip than the configuration allows.
            ControlSilent: control does not answer.
        """
        record = self._source.fresh_record()
        check_enabled(record)
        report = record["outcome"]["report"][0]
        if record["header"]["path_id"][0] != 0:
            raise NotReady(safety_of(record).name, "a path is playing; stop it first")
        distance_mm = float(np.linalg.norm(position - report["commanded_position"])) * 1e3
        if distance_mm > self._farthest_mm:
            raise TargetTooFar(distance_mm, self._farthest_mm)
        self._next_sequence += 1
        kept = report["desired_wxyz"].copy() if wxyz is None else wxyz
        self._target = Target(self._next_sequence, position, kept)
        self._still_since = None
        self._send(self._target, clutch=True)
        return await self._followed(self._target)

    async def _followed(self, target: Target) -> NDArray[Any]:
        ends = time.monotonic() + _ANSWER_S
        while time.monotonic() < ends:
            record = self._source.fresh_record()
            leader, state = record["input"]["leader"][0], record["outcome"]["state"][0]
            mine = leader["kind"] == LeaderKind.API_TARGET
            if self._target is not target:
                return record
            if mine and leader["sequence"] == target.sequence and leader["clutch"]:
                if state["engaged"]:
                    self._source.forget_texts()
                    return record
                refused = record["outcome"]["report"]["target_refused"][0]
                if refused or safety_of(record) != Safety.ENABLED:
                    break
            await asyncio.sleep(_POLL_S)
        self.clear()
        raise self._explanation(self._source.fresh_record())

    @staticmethod
    def _explanation(record: NDArray[Any]) -> NotReady:
        """Why control does not follow the target."""
        check_enabled(record)
        state = record["outcome"]["state"][0]
        refused = Refusal(int(record["outcome"]["report"]["target_refused"][0]))
        if refused == Refusal.HOLD_NOT_PRESSED:
            return NotReady("ENABLED", "hold-to-move is on and not pressed")
        if state["engaged"]:
            leader = LeaderKind(int(state["leader_kind"])).name.lower()
            return NotReady("ENABLED", f"the {leader} leads the tip; let it go first")
        return NotReady("ENABLED", "control did not follow the target")

    def clear(self) -> None:
        """Let the target go; the tip stays where it is."""
        if self._target is not None:
            target, self._target = self._target, None
            self._send(target, clutch=False)

    def repeat(self) -> None:
        """Repeat the target, or let it go when it is reached or overruled; every ``REPEAT_S``."""
        if self._target is None:
            return
        record = self._source.record()
        if record is None or safety_of(record) != Safety.ENABLED or self._is_over(record):
            self.clear()
        else:
            self._send(self._target, clutch=True)

    def _is_over(self, record: NDArray[Any]) -> bool:
        state, report = record["outcome"]["state"][0], record["outcome"]["report"][0]
        if state["engaged"] and state["leader_kind"] != LeaderKind.API_TARGET:
            return True
        twist = report["twist"]
        still = (
            np.linalg.norm(twist[:3]) * 1e3 < _STILL_MM_S
            and np.rad2deg(np.linalg.norm(twist[3:])) < _STILL_DEG_S
        )
        now = time.monotonic()
        if not still:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = now
        return self._still_since is not None and now - self._still_since > _SETTLED_S

    def _send(self, target: Target, clutch: bool) -> None:
        self._link.leader(
            LeaderKind.API_TARGET,
            sequence=target.sequence,
            clutch=clutch,
            position=target.position,
            wxyz=target.wxyz,
            absolute=True,
            smoothing_s=0.0,
            timeout_s=_TARGET_TIMEOUT_S,
        )


class PoseLeader:
    """Samples of a clutched leader outside, as they come. Belongs to the event loop.

    Args:
        link: to the control process.
        source: of the newest record.
        configuration: how soon a sample is stale.
    """

    def __init__(self, link: WebLink, source: StateSource, configuration: Configuration) -> None:
        self._link, self._source = link, source
        self._timeout_s = configuration.teleoperation.api_timeout_ms * 1e-3
        self._sequence = 0
        self._closed = False

    def sample(self, position: NDArray[np.float64], wxyz: NDArray[np.float64], clutch: bool) -> int:
        """Take one sample; returns its number.

        Args:
            position: (3,) in m, the leader's own frame.
            wxyz: (4,) quaternion, the leader's own frame.
            clutch: whether the leader is engaged.

        Raises:
            NotReady: the clutch is closed while the robot is not enabled.
            ControlSilent: control does not answer.
        """
        if clutch:
            check_enabled(self._source.fresh_record())
        self._sequence += 1
        self._closed = clutch
        self._send(position, wxyz, clutch)
        return self._sequence

    def open(self) -> None:
        """Open the clutch on behalf of a leader whose operator is gone."""
        if self._closed:
            self._closed = False
            self._sequence += 1
            self._send(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), clutch=False)

    def _send(self, position: NDArray[np.float64], wxyz: NDArray[np.float64], clutch: bool) -> None:
        self._link.leader(
            LeaderKind.API_POSE,
            sequence=self._sequence,
            clutch=clutch,
            position=position,
            wxyz=wxyz,
            absolute=False,
            smoothing_s=0.0,
            timeout_s=self._timeout_s,
        )
