"""A trocar that breathes: how the body wall carries it along, as a function of time alone.

A breath moves the trocar along the wall's normal by a (1 - cos) / 2 and back. Every breath begins
and ends at rest in the registered place, so what is changed meanwhile waits for the next breath,
and neither place nor velocity ever jumps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Breathing:
    """How deep and how fast the body breathes.

    Attributes:
        amplitude_m: from rest to the top of a breath, m; 0 for a trocar that stands still.
        period_s: length of a breath, s.
    """

    amplitude_m: float = 0.0
    period_s: float = 4.0


STILL = Breathing()
"""Not at all."""


@dataclass(frozen=True)
class TrocarMotion:
    """The breath that is drawn, and what follows it.

    Attributes:
        present: of the breaths since ``since_s``.
        since_s: when the first of them began.
        following: of the breaths from ``until_s`` on.
        until_s: when the last of the present breaths ends; infinite where none follows.
    """

    present: Breathing = STILL
    since_s: float = 0.0
    following: Breathing = STILL
    until_s: float = math.inf

    def changed(self, breathing: Breathing, time_s: float) -> TrocarMotion:
        """The motion that goes on as this one and, with the next breath after ``time_s``, becomes
        ``breathing``.
        """
        present, since_s = self._at(time_s)
        if present.amplitude_m == 0.0:
            return TrocarMotion(breathing, time_s)
        if time_s < self.until_s < math.inf:
            return replace(self, following=breathing)
        breaths = math.floor((time_s - since_s) / present.period_s) + 1
        return TrocarMotion(present, since_s, breathing, since_s + breaths * present.period_s)

    def displacement(self, time_s: float) -> float:
        """How far the trocar is out of its registered place along the wall's normal, m."""
        breathing, since_s = self._at(time_s)
        phase = 2.0 * math.pi * (time_s - since_s) / breathing.period_s
        return 0.5 * breathing.amplitude_m * (1.0 - math.cos(phase))

    def velocity(self, time_s: float) -> float:
        """Time derivative of :meth:`displacement`, m/s."""
        breathing, since_s = self._at(time_s)
        rate = 2.0 * math.pi / breathing.period_s
        return 0.5 * breathing.amplitude_m * rate * math.sin(rate * (time_s - since_s))

    def wanted(self) -> Breathing:
        """What was asked for last, in force now or with the next breath."""
        return self.present if self.until_s == math.inf else self.following

    def _at(self, time_s: float) -> tuple[Breathing, float]:
        if time_s < self.until_s:
            return self.present, self.since_s
        return self.following, self.until_s
