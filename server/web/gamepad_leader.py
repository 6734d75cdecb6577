"""A gamepad at the operator's browser: sticks are rates, which are added up to a pose here.

The page sends what the sticks say; how far the time between two samples was is measured here and
bounded, so that a page that stalls makes no jump of it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.records import DriveMode, LeaderKind
from robot.rotations import exponential, multiply, quaternion_from_matrix
from server.leaders.buttons import ButtonScheme
from server.memory.link import WebLink
from server.web.control_requests import check_enabled
from server.web.state_source import StateSource

DEAD_ZONE = 0.12
"""Sticks do not come back to zero."""

SPEED_M_S = 0.03
TURN_RAD_S = math.radians(30.0)
"""With a stick at its end, before the motion scale."""

LONGEST_STEP_S = 0.05
TIMEOUT_S = 0.12
_SMOOTHING_S = 0.03

Axes = tuple[float, float, float, float, float, float]


def rate(deflection: float) -> float:
    """Share of full speed, -1 to 1, of a stick deflected by -1 to 1: fine near the middle."""
    size = (abs(deflection) - DEAD_ZONE) / (1.0 - DEAD_ZONE)
    return math.copysign(min(size, 1.0) ** 2, deflection) if size > 0.0 else 0.0


class GamepadLeader:
    """Leads by a gamepad. Belongs to the event loop.

    Args:
        link: to the control process.
        source: of the newest record.
        configuration: what the shoulder buttons mean (as those of a stylus).
        clock: monotonic clock in seconds.
    """

    def __init__(
        self,
        link: WebLink,
        source: StateSource,
        configuration: Configuration,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._link, self._source, self._clock = link, source, clock
        self._scheme = ButtonScheme(configuration.stylus)
        self._position = np.zeros(3)
        self._rotation = np.eye(3)
        self._sequence, self._closed, self._ignored = 0, False, False
        self._at = -math.inf

    def sample(self, axes: Axes, buttons: int) -> None:
        """Take one sample of the page.

        Args:
            axes: right, up, toward the operator; then turns about those axes; -1 to 1 each.
            buttons: the pressed shoulder buttons, bit 0 the left.

        Raises:
            NotReady: a shoulder button is pressed while the robot is not enabled; once a press.
            ControlSilent: control does not answer.
        """
        now = self._clock()
        mode = self._scheme.mode(buttons)
        if mode is None:
            self._ignored = False
            self.open()
        if mode is None or self._ignored:
            return
        try:
            check_enabled(self._source.fresh_record())
        except KeyholeError:
            # Told once; what is pressed now must be let go before it counts again.
            self._ignored = True
            self.open()
            raise
        if not self._closed:
            self._at = now
        step = min(max(now - self._at, 0.0), LONGEST_STEP_S)
        self._at = now
        self._position += step * SPEED_M_S * np.array([rate(axis) for axis in axes[:3]])
        turn, turned = np.empty((3, 3)), np.empty((3, 3))
        exponential(step * TURN_RAD_S * np.array([rate(axis) for axis in axes[3:]]), turn)
        multiply(turn, self._rotation, turned)
        self._rotation[:] = turned
        self._closed = True
        self._send(mode)

    def open(self) -> None:
        """Open the clutch: nothing is pressed, or the operator is gone."""
        if self._closed:
            self._closed = False
            self._send(DriveMode.BOTH)
            # Relative to the next clutch all starts at zero, and rounding does not add up.
            self._position[:] = 0.0
            self._rotation[:] = np.eye(3)

    def _send(self, mode: DriveMode) -> None:
        self._sequence += 1
        wxyz: NDArray[np.float64] = np.empty(4)
        quaternion_from_matrix(self._rotation, wxyz)
        self._link.leader(
            LeaderKind.GAMEPAD,
            sequence=self._sequence,
            clutch=self._closed,
            position=self._position,
            wxyz=wxyz,
            absolute=False,
            smoothing_s=_SMOOTHING_S,
            timeout_s=TIMEOUT_S,
            mode=mode,
        )
