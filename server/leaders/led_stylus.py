"""Whether the stylus leads, since when, and what its force turns into."""

from __future__ import annotations

from typing import Protocol

from robot.records import LeaderKind
from server.leaders.control_view import ControlView

ONSET_S = 0.3
"""How long a force takes to come to its full strength."""

Force = tuple[float, float, float]
NO_FORCE: Force = (0.0, 0.0, 0.0)


class StylusForce(Protocol):
    """What a stylus is made to feel."""

    @property
    def is_engaged(self) -> bool:
        """Whether the stylus leads, as of the view's last update."""

    def at(self, position: Force, now_ns: int) -> Force:
        """The force in N, in the stylus' frame, on a stylus at ``position`` (m, the same frame)."""


class LedStylus:
    """The stylus as control has it.

    Attributes:
        state: of the newest record, () fields as arrays of one.
        outcome: likewise.
        turn: (3, 3) from the stylus' frame to the base frame.
    """

    def __init__(self, view: ControlView) -> None:
        self._view, self._engaged_ns = view, 0
        self.outcome = view.record["outcome"][0]
        self.state = self.outcome["state"]
        self.turn = self.state["anchor_rotation_base_leader"]

    @property
    def is_engaged(self) -> bool:
        """Whether the stylus leads, as of the view's last update."""
        state = self.state
        return bool(
            self._view.enabled and state["engaged"] and state["leader_kind"] == LeaderKind.STYLUS
        )

    def onset(self, now_ns: int) -> float:
        """Share of its strength that a force has now: 0 while the stylus does not lead."""
        if not self.is_engaged:
            self._engaged_ns = 0
            return 0.0
        self._engaged_ns = self._engaged_ns or now_ns
        return min(1.0, (now_ns - self._engaged_ns) * 1e-9 / ONSET_S)
