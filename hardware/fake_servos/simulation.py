"""Servos, tendons and segment going on together in time, and what they truly did."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from hardware.fake_servos.motor import STALL_TORQUE_NM
from hardware.fake_servos.servo import Servo
from hardware.fake_servos.tendons import Segment, SegmentShape
from hardware.servos.control_table import CENTRE_TICK, TICKS_PER_TURN

TENDONS = 4
_STEP_NS, _SMALLEST_STEP_NS = 1_000_000, 250_000
_RAD_PER_TICK = 2.0 * math.pi / TICKS_PER_TURN
_KEPT = 60_000
"""Samples of the true motion that are remembered: a minute of moving without rest."""


@dataclass(frozen=True)
class Mounting:
    """How the servos are built in.

    Attributes:
        ids: in the order of their tendons.
        baud_rate: of all of them at first.
        directions: +1 where larger ticks pay the tendon out, -1 where they pull it in.
        ticks: where the shafts stand at first.
        slack_m: of each tendon then; negative ones are stretched from the beginning.
        shape: of the segment.
    """

    ids: tuple[int, ...] = (101, 102, 103, 104)
    baud_rate: int = 1_000_000
    directions: tuple[int, ...] = (1, 1, 1, 1)
    ticks: tuple[float, ...] = (2012.0, 2101.0, 2048.0, 1987.0)
    slack_m: tuple[float, ...] = (0.8e-3, 1.2e-3, 1.0e-3, 0.6e-3)
    shape: SegmentShape = field(default_factory=SegmentShape)


class Sample(NamedTuple):
    """Where everything truly was at one moment.

    Attributes:
        stamp_ns: monotonic clock.
        ticks: of the shafts; what encoders read when they are not stuck.
        bend_rad: (u, v) of the segment.
    """

    stamp_ns: int
    ticks: tuple[float, ...]
    bend_rad: tuple[float, float]


class Simulation:
    """The mechanics behind the bus.

    With four servos they pull on one segment; with another number they run free.

    Args:
        mounting: what is built in.
        now_ns: monotonic clock.

    Attributes:
        servos: in the order of their tendons.
        directions: how each is mounted; see :meth:`reverse`.
        segment: what they bend.
        samples: the true motion, newest last; nothing is added while all stand still.
    """

    def __init__(self, mounting: Mounting, now_ns: int) -> None:
        turns = [*mounting.ticks, *[CENTRE_TICK] * len(mounting.ids)]
        self.servos = [
            Servo(number, mounting.baud_rate, tick)
            for number, tick in zip(mounting.ids, turns, strict=False)
        ]
        self.directions = list(mounting.directions)
        self.segment = Segment(mounting.shape)
        self.samples: deque[Sample] = deque(maxlen=_KEPT)
        self._zero = [servo.motor.position for servo in self.servos]
        self._spool = [0.0] * len(self.servos)
        self._slack = list(mounting.slack_m)
        self._load = [0.0] * len(self.servos)
        self._now_ns = now_ns
        self._still = False
        self._settle()
        self._note()

    @property
    def now_ns(self) -> int:
        """How far time has gone."""
        return self._now_ns

    @property
    def still(self) -> bool:
        """Whether nothing moves, and nothing will by itself."""
        return self._still

    def disturb(self) -> None:
        """Something was changed from outside: do not take it for still any more."""
        self._still = False

    def advance(self, to_ns: int) -> None:
        """Go on until ``to_ns``, or a quarter of a millisecond less; going back is ignored."""
        while to_ns - self._now_ns >= _SMALLEST_STEP_NS:
            if self._still and not self._wakes(to_ns):
                self._now_ns = to_ns
                return
            step_ns = min(_STEP_NS, to_ns - self._now_ns)
            self._now_ns += step_ns
            seconds = step_ns * 1e-9
            for servo, load in zip(self.servos, self._load, strict=True):
                servo.step(self._now_ns, seconds, load)
            self._settle()
            self._note()
            # A rest is one that lasted a whole step, or a load could still be about to change.
            resting = all(servo.motor.at_rest for servo in self.servos)
            self._still = resting and step_ns == _STEP_NS

    def _wakes(self, to_ns: int) -> bool:
        """Whether a watchdog will trip before then: that must be noticed at its time."""
        due = [deadline for servo in self.servos if (deadline := servo.watchdog_ns())]
        if due and min(due) <= to_ns:
            self._now_ns = max(self._now_ns, min(*due, to_ns - 1))
            self._still = False
            return True
        return False

    def _settle(self) -> None:
        if len(self.servos) != TENDONS:
            return
        for index, servo in enumerate(self.servos):
            turned = (servo.motor.position - self._zero[index]) * _RAD_PER_TICK
            self._spool[index] = self.directions[index] * turned
        self.segment.settle(self._spool, self._slack)
        share = self.segment.shape.pulley_radius_m / STALL_TORQUE_NM
        for index, tension in enumerate(self.segment.tensions_n):
            self._load[index] = self.directions[index] * tension * share

    def _note(self) -> None:
        ticks = tuple(servo.motor.position for servo in self.servos)
        bend = (self.segment.u, self.segment.v)
        if not self.samples or self.samples[-1].ticks != ticks:
            self.samples.append(Sample(self._now_ns, ticks, bend))

    def reverse(self, index: int) -> None:
        """Mount a servo the other way round, without moving its tendon."""
        servo = self.servos[index]
        turned = servo.motor.position - self._zero[index]
        self._zero[index] = servo.motor.position + turned
        self.directions[index] = -self.directions[index]
        self._still = False
        self._settle()

    def true_ticks(self) -> Sequence[float]:
        """Where the shafts stand."""
        return [servo.motor.position for servo in self.servos]
