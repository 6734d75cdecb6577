"""The force that a stylus renders: a spring toward where the tip could follow.

With the anchors of :mod:`robot.teleoperation`, the stylus asks for
p_target = p_tip_anchor + scale R_bl (p_stylus - p_stylus_anchor); where the commanded tip is
p_commanded, the force in the stylus' frame is

    F = k R_bl^T (p_commanded - p_target), no longer than the limit.

It is zero unless the stylus leads, grows over ``ONSET_S`` when it begins to, and is zero at once
when it ends to, when control is silent, and when the place is locked (there it would be a wall).
"""

from __future__ import annotations

import math

from robot.configuration import Stylus
from robot.records import LeaderKind
from server.leaders.control_view import ControlView

ONSET_S = 0.3
"""How long the force takes to come to its full strength."""

Force = tuple[float, float, float]
NO_FORCE: Force = (0.0, 0.0, 0.0)


class SpringForce:
    """Computes the force of one stylus.

    Args:
        configuration: the section ``[stylus]``.
        view: of the control process.
    """

    def __init__(self, configuration: Stylus, view: ControlView) -> None:
        self._stiffness = configuration.force_stiffness_n_m
        self._limit = configuration.force_limit_n
        self._view, self._engaged_ns = view, 0
        outcome = view.record["outcome"][0]
        self._state = state = outcome["state"]
        self._commanded = outcome["report"]["commanded_position"]
        self._anchor, self._anchor_tip = (
            state["anchor_leader_position"],
            state["anchor_tip_position"],
        )
        self._turn = state["anchor_rotation_base_leader"]

    @property
    def is_engaged(self) -> bool:
        """Whether the stylus leads, as of the view's last update."""
        state = self._state
        return bool(
            self._view.enabled and state["engaged"] and state["leader_kind"] == LeaderKind.STYLUS
        )

    def at(self, position: Force, now_ns: int) -> Force:
        """The force in N, in the stylus' frame, on a stylus at ``position`` (m, the same frame)."""
        state = self._state
        if not self.is_engaged:
            self._engaged_ns = 0
            return NO_FORCE
        self._engaged_ns = self._engaged_ns or now_ns
        if state["anchor_lock_translation"] or not math.isfinite(sum(position)):
            return NO_FORCE
        scale = float(state["anchor_scale"])
        turn = self._turn.tolist()
        anchor, tip, commanded = (
            self._anchor.tolist(),
            self._anchor_tip.tolist(),
            self._commanded.tolist(),
        )
        moved = [scale * (position[i] - anchor[i]) for i in range(3)]
        lag = [
            commanded[i] - tip[i] - sum(turn[i][j] * moved[j] for j in range(3)) for i in range(3)
        ]
        x, y, z = (self._stiffness * sum(turn[j][i] * lag[j] for j in range(3)) for i in range(3))
        size = math.sqrt(x * x + y * y + z * z)
        if not math.isfinite(size):
            return NO_FORCE
        share = min(1.0, (now_ns - self._engaged_ns) * 1e-9 / ONSET_S)
        if size > self._limit:
            share *= self._limit / size
        return x * share, y * share, z * share
