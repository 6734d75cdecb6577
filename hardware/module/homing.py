"""Homing: make every tendon taut, see that each pulls the right way, leave all under pretension.

The segment must be free and stand straight: the posture in which all four tendons are taut becomes
the zero. Everything is slow and ends on load, never on distance alone. A tendon is taut when its
servo's load says so; a servo that turns the wrong way is found because it never gets there, and
does when it turns the other way; tendons in the wrong order are found because pulling one loads the
one on the other side of the segment, and only that.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence

from hardware.module.errors import NeverLoose, NeverTaut, WrongDirection, WrongTendon
from hardware.module.transmission import Transmission
from hardware.servos.control_table import TABLE
from robot.configuration import Servos
from robot.records import SERVOS

_SURE = 3
"""Readings in a row that make a load certain."""
_PAY_OUT_DEG = 60.0
"""After so much a tendon that is let out must bear less than before; at the homing range, none."""
_TEST_LOAD = 0.05
"""How much more one servo is loaded to see who answers: friction in the gears hides less."""
_ANSWERS = 0.3
"""Share of it that the tendon that answers shows at least."""
_NOISE = 0.01
"""Loads of servos that stand still differ by so much."""
_SETTLE_S = 0.15
_PAIRS = ((0, 2), (1, 3))
_SHARE = 0.01 * TABLE["present_load"].unit_scale

_Steps = Generator[None, None, None]


class Homing:
    """One homing, from cycle to cycle.

    Attributes:
        goals: ticks for the next cycle; when it is done, the zero.
        origin: ticks at which the segment is taken to be straight before it begins.
        progress: 0 to 1.
    """

    def __init__(
        self,
        transmission: Transmission,
        settings: Servos,
        dt_s: float,
        origin: Sequence[float] | None = None,
    ) -> None:
        """Prepare to be called every ``dt_s``.

        Args:
            transmission: directions of the servos.
            settings: speeds and loads.
            dt_s: between two cycles.
            origin: ticks at which the segment was straight before, if that is known; where a homing
                that was broken off has begun, or the last zero. It goes there first.
        """
        self.origin = None if origin is None else list(origin)
        self.goals = [0.0] * SERVOS
        self.progress = 0.0
        self._directions, self._ids = transmission.directions, settings.ids
        ticks_per_deg = math.radians(transmission.ticks_per_rad)
        self._step = settings.homing_speed_deg_s * ticks_per_deg * dt_s
        self._range = settings.homing_range_deg * ticks_per_deg
        self._pay_out = _PAY_OUT_DEG * ticks_per_deg
        self._ticks_per_deg = ticks_per_deg
        self._taut = 0.01 * settings.taut_load_percent
        self._most = 0.005 * (settings.pretension_load_percent + settings.load_limit_percent)
        self._pretension = 0.01 * settings.pretension_load_percent
        self._settling = math.ceil(_SETTLE_S / dt_s)
        self._pull = [0.0] * SERVOS
        self._steps = self._run()
        self._started = False

    def step(self, position: Sequence[int], load: Sequence[int]) -> bool:
        """Take in one cycle and set the next goals; True when it is done.

        Raises:
            NeverTaut: if a tendon is too slack, or torn.
            NeverLoose: if a tendon stays under load although it is let out.
            WrongDirection: if a servo turns the other way than configured.
            WrongTendon: if the servos' order is not that of the tendons.
        """
        for index, direction in enumerate(self._directions):
            self._pull[index] = -direction * load[index] * _SHARE
        if not self._started:
            self.goals[:] = position
            self.origin = self.origin or list(self.goals)
            self._started = True
        return next(self._steps, True) is not None

    def _run(self) -> _Steps:
        yield from self._go_back()
        yield from self._let_out()
        self.progress = 0.1
        yield from self._tighten()
        self.progress = 0.5
        for first, second in _PAIRS:
            yield from self._pretension_pair(first, second)
            self.progress += 0.25

    def _move(self, index: int, ticks: float) -> None:
        """Pull (or let out, where negative) one tendon."""
        self.goals[index] -= self._directions[index] * ticks

    def _go_back(self) -> _Steps:
        """Undo what an earlier homing or motion has bent; no tendon is pulled near its limit."""
        assert self.origin is not None
        left = True
        while left:
            left = False
            for index in range(SERVOS):
                way = self.origin[index] - self.goals[index]
                pulls = way * self._directions[index] < 0.0
                if abs(way) < 1.0 or (pulls and self._pull[index] > self._most):
                    continue
                self.goals[index] += min(max(way, -self._step), self._step)
                left = True
            yield

    def _let_out(self) -> _Steps:
        """Let go of what is under tension already, so that the segment is free to be straight."""
        loose, travel = 0, 0.0
        before = list(self._pull)
        while loose < _SURE:
            tight = [index for index in range(SERVOS) if abs(self._pull[index]) > 0.5 * self._taut]
            loose = 0 if tight else loose + 1
            if tight and travel > self._pay_out:
                worst = max(tight, key=lambda index: abs(self._pull[index]))
                if abs(self._pull[worst]) > abs(before[worst]):
                    raise WrongDirection(self._ids[worst], self._directions[worst])
                if travel > self._range:
                    raise NeverLoose([self._ids[worst]], self._range / self._ticks_per_deg)
            if tight:
                # All alike, which keeps straight what is straight.
                for index in range(SERVOS):
                    self._move(index, -self._step)
                travel += self._step
            yield

    def _tighten(self) -> _Steps:
        """Pull opposite tendons alike until both are taut: a free segment shares the load out."""
        sure, travel = [0, 0], 0.0
        while min(sure) < _SURE:
            for pair, (first, second) in enumerate(_PAIRS):
                loads = self._pull[first], self._pull[second]
                if sure[pair] >= _SURE:
                    continue
                if sum(loads) >= 2.0 * self._taut and min(loads) >= 0.5 * self._taut:
                    sure[pair] += 1
                    continue
                sure[pair] = 0
                for index in (first, second):
                    if self._pull[index] < self._pretension:
                        self._move(index, self._step)
            travel += self._step
            if travel > self._range:
                slack = [index for index in range(SERVOS) if self._pull[index] < 0.5 * self._taut]
                yield from self._explain(slack or list(range(SERVOS)))
            yield

    def _explain(self, slack: list[int]) -> _Steps:
        """Find out why tendons did not become taut, by turning the first one the other way.

        Raises:
            WrongDirection: if it becomes taut that way.
            NeverTaut: if it does not.
        """
        index, sure = slack[0], 0
        way = self._range
        travel = 0.0
        while travel < 2.0 * way and sure < _SURE:
            self._move(index, -self._step)
            travel += self._step
            sure = sure + 1 if abs(self._pull[index]) >= self._taut else 0
            yield
        if sure >= _SURE:
            raise WrongDirection(self._ids[index], self._directions[index])
        names = [self._ids[index] for index in slack]
        raise NeverTaut(names, self._range / self._ticks_per_deg)

    def _settle(self) -> _Steps:
        """Let the servos come to rest."""
        for _ in range(self._settling):
            yield

    def _pretension_pair(self, first: int, second: int) -> _Steps:
        """Pull ``first`` until it is loaded, see who is loaded by it, then share it out evenly."""
        yield from self._settle()
        before = list(self._pull)
        wanted = max(self._pretension, before[first] + _TEST_LOAD)
        travel, sure = 0.0, 0
        while sure < _SURE:
            if self._pull[first] >= wanted:
                sure += 1
            else:
                sure = 0
                self._move(first, self._step)
                travel += self._step
            if travel > self._range:
                names = [self._ids[first]]
                raise NeverTaut(names, self._range / self._ticks_per_deg)
            yield
        yield from self._settle()
        rise = [now - then for now, then in zip(self._pull, before, strict=True)]
        others = [index for index in range(SERVOS) if index != first]
        loaded = max(others, key=lambda index: rise[index])
        least = max(_ANSWERS * rise[first], 2.0 * rise[second], _NOISE)
        if loaded != second and rise[loaded] > least:
            raise WrongTendon(self._ids[first], self._ids[loaded], self._ids[second])
        shared = 0.0
        while shared < 0.5 * travel:
            step = min(self._step, 0.5 * travel - shared)
            self._move(first, -step)
            self._move(second, step)
            shared += step
            yield
