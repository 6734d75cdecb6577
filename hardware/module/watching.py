"""What is wrong with the servos, seen from cycle to cycle. Looks at numbers only; acts on nothing.

One bad answer is tolerated; two in a row of the same servo are an event.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from hardware.servos.control_table import TABLE
from hardware.servos.cyclic import CyclicExchange
from hardware.servos.protocol import ALERT
from robot.configuration import Servos
from robot.records import SERVOS
from robot.safety import Event

MISSES = 2
"""Missed cycles in a row that are an event."""

_LASTING = 5
"""Cycles in a row outside a limit that are an event: one reading may be a spike."""
_STUCK_RAD = math.radians(2.5)
_STUCK_S = 0.1
"""A goal that went so far, and so long ago, while the encoder said nothing moved."""
_MOVES_TICKS = 2
_LOAD_UNIT = TABLE["present_load"].unit_scale
_VOLT_UNIT = TABLE["present_input_voltage"].unit_scale


class ServoWatch:
    """Watches four servos.

    Attributes:
        event: a ``robot.safety.Event``, as long as its cause lasts; 0 without one.
        message: what, and what to do; empty without an event.
        alerts: a bit for each servo that tells of a hardware error.
        missed: cycles in a row without an answer, of each servo.
    """

    def __init__(self, settings: Servos, ticks_per_rad: float) -> None:
        """Watch for the limits in ``settings``."""
        self.event, self.message = 0, ""
        self.alerts = 0
        self.missed = [0] * SERVOS
        self._settings = settings
        self._largest_load = settings.load_limit_percent / _LOAD_UNIT
        self._lowest_volt = settings.voltage_min_v / _VOLT_UNIT
        self._highest_volt = settings.voltage_max_v / _VOLT_UNIT
        self._stuck = _STUCK_RAD * ticks_per_rad
        self._stuck_cycles = math.ceil(_STUCK_S * settings.rate_hz)
        self._outside = [0] * SERVOS
        self._still = [0] * SERVOS
        self._rest_position = [0] * SERVOS
        self._rest_goal = [0] * SERVOS

    def forget(self, cycle: CyclicExchange, goals: Sequence[int]) -> None:
        """Begin anew, as after a reconnection."""
        self.event, self.message, self.alerts = 0, "", 0
        for index in range(SERVOS):
            self.missed[index] = self._outside[index] = self._still[index] = 0
            self._rest_position[index] = cycle.position[index]
            self._rest_goal[index] = goals[index]

    def look(self, answered: int, cycle: CyclicExchange, goals: Sequence[int]) -> None:
        """Take in one cycle.

        Args:
            answered: a bit for each servo that answered.
            cycle: what they answered.
            goals: what they were told, ticks.
        """
        event, message = 0, ""
        self.alerts = 0
        for index, servo in enumerate(self._settings.ids):
            if not answered >> index & 1:
                self.missed[index] += 1
                # Behind a silent servo nobody else is heard: the first one is meant.
                if self.missed[index] >= MISSES and event != Event.SERVO_SILENT:
                    event = int(Event.SERVO_SILENT)
                    message = f"servo {servo} does not answer; check its cable and power"
                continue
            self.missed[index] = 0
            if cycle.error[index] & ALERT:
                self.alerts |= 1 << index
            wrong = self._look_at(index, cycle, goals[index])
            if wrong and not event:
                event, message = int(Event.SERVO_FAULT), f"servo {servo}: {wrong}"
        if self.alerts and event != Event.SERVO_SILENT:
            # Which error it is stands in another register and is told once that is read.
            event = int(Event.SERVO_FAULT)
            message = message or "a servo tells of a hardware error"
        self.event, self.message = event, message

    def _look_at(self, index: int, cycle: CyclicExchange, goal: int) -> str:
        wrong = self._outside_limits(
            cycle.load[index], cycle.voltage[index], cycle.temperature[index]
        )
        self._outside[index] = self._outside[index] + 1 if wrong else 0
        if self._outside[index] >= _LASTING:
            return wrong
        position = cycle.position[index]
        if abs(position - self._rest_position[index]) >= _MOVES_TICKS:
            self._rest_position[index], self._rest_goal[index] = position, goal
            self._still[index] = 0
        elif abs(goal - self._rest_goal[index]) > self._stuck:
            self._still[index] += 1
        else:
            self._still[index] = 0
        if self._still[index] >= self._stuck_cycles:
            return "stands still while its goal moves: its encoder is stuck or the tendon blocked"
        return ""

    def _outside_limits(self, load: int, volt: int, celsius: int) -> str:
        settings = self._settings
        if celsius > settings.temperature_limit_c:
            return f"{celsius} °C, above [servos] temperature_limit_c; let it cool down"
        if not self._lowest_volt <= volt <= self._highest_volt:
            return f"{volt * _VOLT_UNIT:.1f} V, outside [servos] voltage_min_v and _max_v"
        if abs(load) > self._largest_load:
            return f"load {abs(load) * _LOAD_UNIT:.0f} %, above [servos] load_limit_percent"
        return ""
