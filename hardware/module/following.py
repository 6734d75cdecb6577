"""What the servos are told in the next cycle: the newest command, limited, or where they hold."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hardware.module.preparation import resting_goal
from hardware.module.transmission import Transmission
from robot.records import SERVOS

STALE_NS = 25_000_000
"""A command older than this is not followed: the deadline of stylus and API."""

_NEAR_RAD = math.radians(5.0)
"""How far a new motion may begin from where the servos hold: what friction and load leave open."""


class Follower:
    """Goals of the servos.

    After :meth:`hold` commands are ignored until the robot has rested and then begins to move from
    where the servos are, which takes a person who enables it.

    Attributes:
        goals: ticks, what is written next.
        holding: whether commands are ignored.
        stale: whether the newest command of a motion has become too old.
        refusing: whether a motion is ignored that does not begin where the servos are.
    """

    def __init__(self, transmission: Transmission, speed_rad_s: float) -> None:
        """Turn no faster than ``speed_rad_s``."""
        self.goals = [0] * SERVOS
        self.holding = True
        self.stale = self.refusing = False
        self._transmission = transmission
        self._speed = speed_rad_s * transmission.ticks_per_rad
        self._near = _NEAR_RAD * transmission.ticks_per_rad
        self._rested = False
        self._exact = [0.0] * SERVOS
        self._wanted = [0.0] * SERVOS

    def hold(self, position: Sequence[int], load: Sequence[int]) -> None:
        """Stop at ``position`` (ticks), with the ``load`` (of the register) that is carried."""
        self.holding, self._rested, self.refusing = True, False, False
        for index, tick in enumerate(position):
            self.goals[index] = resting_goal(self.goals[index], tick, load[index])
            self._exact[index] = self.goals[index]

    def take(self, goals: Sequence[float]) -> None:
        """Goals of somebody else, such as homing."""
        for index, goal in enumerate(goals):
            self._exact[index] = goal
            self.goals[index] = round(goal)

    def follow(self, angles: Sequence[float], moving: bool, age_ns: int, dt_s: float) -> None:
        """Move the goals toward a command.

        Args:
            angles: four servo angles, rad.
            moving: whether the command is one of a motion.
            age_ns: how long ago it was given.
            dt_s: since the last call.
        """
        self.stale = moving and age_ns > STALE_NS
        if not moving:
            self._rested, self.refusing = True, False
            return
        if self.stale:
            return
        wanted, exact = self._wanted, self._exact
        self._transmission.ticks(angles, wanted)
        if self.holding:
            far = max(abs(a - b) for a, b in zip(wanted, exact, strict=True))
            self.refusing = self._rested and far > self._near
            if not self._rested or self.refusing:
                return
            self.holding = False
        step = self._speed * dt_s
        for index in range(SERVOS):
            way = wanted[index] - exact[index]
            exact[index] += min(max(way, -step), step)
            self.goals[index] = round(exact[index])
