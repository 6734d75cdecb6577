"""Which command goes to the arm now: interpolated, near, inside limits, never too fast.

The control loop writes at its own rate, the arm takes commands at another. Nothing here waits, and
neither side holds the other up.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

JOINTS = 7
_KEPT = 16


class Verdict(IntEnum):
    """What becomes of the newest command."""

    FOLLOWED = 0
    NONE_YET = 1
    FAR = 2
    JUMPED = 3
    OUTSIDE = 4


class CommandRing:
    """The last commands with their times: one thread puts, another looks.

    The number of the newest is published after it is complete. Whoever looks checks afterwards that
    what it read was not overwritten meanwhile.
    """

    def __init__(self) -> None:
        self._stamps = [0] * _KEPT
        self._q = np.zeros((_KEPT, JOINTS))
        self._count = 0

    def put(self, stamp_ns: int, q: np.ndarray) -> None:
        """Add ``q`` (7,), rad, as it is wanted at ``stamp_ns``."""
        place = self._count % _KEPT
        self._stamps[place] = stamp_ns
        self._q[place] = q
        self._count += 1

    def newest(self, out: np.ndarray) -> bool:
        """Fill ``out`` (7,) with the newest command; False where there is none."""
        count = self._count
        if count == 0:
            return False
        out[:] = self._q[(count - 1) % _KEPT]
        return True

    def at(self, stamp_ns: int, out: np.ndarray) -> bool:
        """Fill ``out`` (7,) with the command at a time: on the line between its neighbours.

        After the newest it stays there; before the oldest that is kept, it is that one.

        Returns:
            False where there is none, or where it was overwritten while it was read.
        """
        count = self._count
        if count == 0:
            return False
        oldest = max(count - _KEPT + 2, 0)
        later = count - 1
        while later > oldest and self._stamps[later % _KEPT] > stamp_ns:
            later -= 1
        end = self._stamps[later % _KEPT]
        out[:] = self._q[later % _KEPT]
        if later < count - 1 and stamp_ns > end:
            span = self._stamps[(later + 1) % _KEPT] - end
            out += (self._q[(later + 1) % _KEPT] - out) * ((stamp_ns - end) / max(span, 1))
        return self._count - later < _KEPT


class Follower:
    """Decides what of the commands the arm gets.

    It begins to follow only with a command that has changed since the arm last stood, and that is
    near to where the arm stands: nothing moves because a connection came back, and a first command
    is never a jump. While it follows, joints go no faster than they may.

    Attributes:
        following: whether commands go to the arm.
    """

    def __init__(
        self,
        lower: np.ndarray,
        upper: np.ndarray,
        step: np.ndarray,
        near_rad: float,
        jump_rad: float,
    ) -> None:
        """Follow nothing yet.

        Args:
            lower: (7,) lower joint limits, rad.
            upper: (7,) upper joint limits, rad.
            step: (7,) how far a joint may go from one command to the next, rad.
            near_rad: how far a first command may be from where a joint stands.
            jump_rad: how far a command may be from the last one.
        """
        self._lower, self._upper, self._step = lower, upper, step
        self._near, self._jump = near_rad, jump_rad
        self._ring = CommandRing()
        self._last, self._wanted = np.zeros(JOINTS), np.zeros(JOINTS)
        self._stood = np.full(JOINTS, np.nan)
        self.following = False

    def put(self, stamp_ns: int, q: np.ndarray) -> None:
        """Take a command, from the control loop's thread."""
        self._ring.put(stamp_ns, q)

    def stop(self) -> None:
        """Follow nothing until the command changes."""
        self.following = False
        if not self._ring.newest(self._stood):
            self._stood[:] = np.nan

    def next(self, stamp_ns: int, measured: np.ndarray, out: np.ndarray) -> Verdict:
        """Fill ``out`` (7,) with what the arm should be told for a time.

        Args:
            stamp_ns: the time; commands are interpolated to it.
            measured: (7,) where the joints stand, rad.
            out: (7,) filled where the verdict is FOLLOWED.

        Returns:
            Why it is followed or not. What is not followed ends following, except where the command
            lies outside the limits: then the last one stands.
        """
        if not self.following:
            return self._begin(measured, out)
        if not self._ring.at(stamp_ns, self._wanted):
            out[:] = self._last
            return Verdict.FOLLOWED
        if not bool(np.all((self._wanted >= self._lower) & (self._wanted <= self._upper))):
            return Verdict.OUTSIDE
        way = self._wanted - self._last
        if float(np.max(np.abs(way))) > self._jump:
            self.stop()
            return Verdict.JUMPED
        self._last += np.clip(way, -self._step, self._step)
        out[:] = self._last
        return Verdict.FOLLOWED

    def _begin(self, measured: np.ndarray, out: np.ndarray) -> Verdict:
        if not self._ring.newest(self._wanted):
            return Verdict.NONE_YET
        if bool(np.any(np.isnan(self._stood))):
            self._stood[:] = self._wanted
        if bool(np.array_equal(self._wanted, self._stood)):
            return Verdict.NONE_YET
        if not float(np.max(np.abs(self._wanted - measured))) <= self._near:
            return Verdict.FAR
        if not bool(np.all((self._wanted >= self._lower) & (self._wanted <= self._upper))):
            return Verdict.OUTSIDE
        self._last[:] = measured
        self._last += np.clip(self._wanted - self._last, -self._step, self._step)
        out[:] = self._last
        self.following = True
        return Verdict.FOLLOWED
