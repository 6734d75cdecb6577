"""From servo angles to ticks and back: where straight is, and which way each servo is mounted.

Angles are the controller's: 0 is the straight segment, and a negative angle pulls the tendon
(``robot/tendons.py``). A tendon's length changes by the pulley's radius times the angle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hardware.module.errors import NoRoom
from hardware.servos.control_table import CENTRE_TICK
from robot.configuration import Configuration
from robot.records import SERVOS

_RESERVE = 1.5
"""Room that a servo needs around its zero, over what the largest bend takes: for compensation."""


class Transmission:
    """Zero and direction of four servos.

    Attributes:
        directions: +1 where larger ticks pay the tendon out, else -1.
        zero: ticks of the straight segment.
        ticks_per_rad: of every servo.
        half_range: ticks that a servo may leave its zero by.
    """

    def __init__(self, configuration: Configuration) -> None:
        """As configured; until homing the zero is the middle of the turn."""
        module = configuration.module
        self.directions = configuration.servos.directions
        self.zero = [CENTRE_TICK] * SERVOS
        self.ticks_per_rad = module.servo_ticks_per_turn / (2.0 * math.pi)
        self.half_range = round(self.ticks_per_rad * math.radians(module.servo_range_deg))
        bend = math.radians(configuration.limits.bend_deg)
        ratio = configuration.instrument.tendon_pitch_radius_m / module.pulley_radius_m
        self._least = min(self.half_range, round(_RESERVE * bend * ratio * self.ticks_per_rad))
        self._last = module.servo_ticks_per_turn - 1
        self._ids = configuration.servos.ids
        self._pulley_radius = module.pulley_radius_m

    def set_zero(self, ticks: Sequence[int]) -> None:
        """These ticks are the straight segment.

        Raises:
            NoRoom: if a servo could not bend the segment as far as it may from there.
        """
        for servo, tick in zip(self._ids, ticks, strict=True):
            if not self._least <= tick <= self._last - self._least:
                raise NoRoom(servo, tick, self._least)
        self.zero = list(ticks)

    def ticks(self, angles: Sequence[float], out: list[float]) -> None:
        """Fill ``out`` with the ticks of ``angles`` (rad), cut to the range."""
        for index, angle in enumerate(angles):
            away = angle * self.ticks_per_rad
            away = min(max(away, -self.half_range), self.half_range)
            out[index] = self.zero[index] + self.directions[index] * away

    def angles(self, ticks: Sequence[float], out: np.ndarray) -> None:
        """Fill ``out`` (4,) with the angles in rad of ``ticks``."""
        for index, tick in enumerate(ticks):
            away = (tick - self.zero[index]) / self.ticks_per_rad
            out[index] = self.directions[index] * away

    def pulled_m(self, ticks: Sequence[float]) -> tuple[float, ...]:
        """How much shorter than straight each tendon is at these ticks, m."""
        scale = self._pulley_radius / self.ticks_per_rad
        return tuple(
            -direction * (tick - zero) * scale
            for direction, tick, zero in zip(self.directions, ticks, self.zero, strict=True)
        )
