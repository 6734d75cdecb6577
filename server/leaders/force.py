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
from server.leaders.control_view import ControlView
from server.leaders.led_stylus import NO_FORCE, Force, LedStylus


class SpringForce:
    """Computes the force of one stylus.

    Args:
        configuration: the section ``[stylus]``.
        view: of the control process.
    """

    def __init__(self, configuration: Stylus, view: ControlView) -> None:
        self._stiffness = configuration.force_stiffness_n_m
        self._limit = configuration.force_limit_n
        self._led = LedStylus(view)
        self._commanded = self._led.outcome["report"]["commanded_position"]
        state = self._led.state
        self._anchor, self._anchor_tip = (
            state["anchor_leader_position"],
            state["anchor_tip_position"],
        )

    @property
    def is_engaged(self) -> bool:
        """Whether the stylus leads, as of the view's last update."""
        return self._led.is_engaged

    def at(self, position: Force, now_ns: int) -> Force:
        """The force in N, in the stylus' frame, on a stylus at ``position`` (m, the same frame)."""
        state, share = self._led.state, self._led.onset(now_ns)
        if not self._led.is_engaged:
            return NO_FORCE
        if state["anchor_lock_translation"] or not math.isfinite(sum(position)):
            return NO_FORCE
        scale = float(state["anchor_scale"])
        turn = self._led.turn.tolist()
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
        if size > self._limit:
            share *= self._limit / size
        return x * share, y * share, z * share
