"""The samples of one stylus on their way to control: every fault of a device ends here.

What is not a new, whole pose is dropped and counted. What concerns control is told to it: a pose
that is none while the stylus leads, and, by the age of the sample, silence, delay and buttons that
are dead. A clutch counts only where it closes while the robot is ENABLED; after everything that
interrupts it, all buttons must be let go first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.configuration import Stylus
from robot.records import DriveMode
from server.leaders.buttons import ButtonScheme, ButtonWatch
from server.leaders.stamps import Order, StampOrder
from server.memory.leader_slot import SMALLEST_QUATERNION, LeaderSlot

Position = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

FARTHEST_M = 10.0
"""No stylus is farther from its own origin; a pose in mm is."""

_QUIET_NS = 1_000_000_000
_TOLD_NS = 100_000_000


@dataclass
class StylusCounts:
    """What came from a stylus since the start: ``samples`` that were good, and what was not."""

    samples: int = 0
    malformed: int = 0
    oversized: int = 0
    wrong_topic: int = 0
    invalid: int = 0
    repeated: int = 0
    out_of_order: int = 0
    late: int = 0
    buttons_dead: int = 0


class StylusInput:
    """Judges the samples of one stylus and publishes the newest.

    All times are the host's monotonic clock in ns, except for the stamps of the device.

    Args:
        slot: where samples go.
        configuration: the section ``[stylus]``.

    Attributes:
        counts: of what came.
        clutch: whether the last published sample was engaged.
        mode: what it drives.
        position: (3,) the last good one, m.
        sample_ns: when it came; 0 before the first.
        delay_ns: by how much it came later than the quickest.
        why_not: why pressed buttons do not count, or nothing.
    """

    def __init__(self, slot: LeaderSlot, configuration: Stylus) -> None:
        self._slot = slot
        self._timeout_s = configuration.timeout_ms * 1e-3
        self._timeout_ns = round(configuration.timeout_ms * 1e6)
        self._scheme = ButtonScheme(configuration)
        self.counts = StylusCounts()
        self.clutch, self.mode = False, DriveMode.BOTH
        self.position: Position = (0.0, 0.0, 0.0)
        self._wxyz: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self._sequence = 0
        self.sample_ns = self.delay_ns = 0
        self.why_not = ""
        self.connected(0)

    def connected(self, now_ns: int) -> None:
        """The device was connected anew: nothing that was known of it counts any more."""
        self._poses, self._presses = StampOrder(), StampOrder()
        self.buttons = ButtonWatch(self._timeout_ns)
        self._connected_ns, self._armed, self._dead = now_ns, False, False
        self._is_new, self._refused_ns = False, 0

    @property
    def is_released(self) -> bool:
        """Whether nothing is pressed that would drive."""
        return self._scheme.mode(self.buttons.bits) is None

    def take_buttons(self, bits: int, stamp_ns: int, now_ns: int) -> None:
        """The buttons were told: bit 0 the first, bit 1 the second."""
        order = self._presses.take(stamp_ns, now_ns)
        if order is Order.REPEATED:
            self.counts.repeated += 1
            return
        if order is Order.OUT_OF_ORDER:
            self.counts.out_of_order += 1
            return
        if self.buttons.heard_ns == 0 and now_ns - self._connected_ns > _QUIET_NS:
            # A driver that tells changes only: what comes first is a press, not one that lasts.
            self._armed = True
        self.buttons.heard(bits, now_ns)
        if self.is_released:
            self._armed = True

    def take_pose(self, position: Position, wxyz: Quaternion, stamp_ns: int, now_ns: int) -> None:
        """A pose was told: m and quaternion, in the stylus' own frame."""
        if not is_pose(position, wxyz):
            self._refuse(now_ns)
            return
        order = self._poses.take(stamp_ns, now_ns)
        if order is Order.REPEATED:
            self.counts.repeated += 1
            return
        if order is Order.OUT_OF_ORDER:
            self.counts.out_of_order += 1
            return
        if order is Order.RESET:
            self._armed = False
        self.counts.samples += 1
        self.position, self._wxyz = position, wxyz
        self._sequence = stamp_ns or now_ns
        self.sample_ns, self.delay_ns = now_ns, self._poses.delay_ns
        if self.delay_ns > self._timeout_ns:
            self.counts.late += 1
        self._is_new = True

    def _refuse(self, now_ns: int) -> None:
        self.counts.invalid += 1
        self._is_new = False
        if self.clutch:
            self._slot.write_invalid(now_ns, self._timeout_s)
            self._armed, self._refused_ns = False, now_ns

    def publish(self, now_ns: int, enabled: bool) -> bool:
        """Hand over what has changed since the last call.

        Args:
            now_ns: of this call.
            enabled: whether the robot is ENABLED.

        Returns:
            Whether a sample was published.
        """
        if self._refused_ns and enabled and now_ns - self._refused_ns < _TOLD_NS:
            # The next good pose must not hide from control what it has to pause for.
            return False
        self._refused_ns = 0
        mode = self._scheme.mode(self.buttons.bits)
        clutch = self._may_close(mode, enabled)
        changed = clutch != self.clutch or (clutch and mode is not None and mode != self.mode)
        if self.sample_ns == 0 or not (self._is_new or changed):
            return False
        self._is_new = False
        stamp_ns = self.sample_ns - self.delay_ns
        if clutch and self._are_dead(now_ns):
            # As old as its oldest part, the sample is that of a silent leader: control pauses.
            stamp_ns = min(stamp_ns, self.buttons.heard_ns)
        self.clutch = clutch
        self.mode = mode if clutch and mode is not None else DriveMode.BOTH
        self._slot.write(
            sequence=self._sequence,
            clutch=clutch,
            position=self.position,
            wxyz=self._wxyz,
            absolute=False,
            smoothing_s=0.0,
            timeout_s=self._timeout_s,
            mode=self.mode,
            stamp_ns=stamp_ns,
        )
        return True

    def _are_dead(self, now_ns: int) -> bool:
        dead = self.buttons.are_dead(now_ns)
        if dead and not self._dead:
            self.counts.buttons_dead += 1
        self._dead = dead
        return dead

    def _may_close(self, mode: DriveMode | None, enabled: bool) -> bool:
        """Whether the clutch is closed, given what the buttons ask for."""
        if mode is None:
            self.why_not = ""
            return False
        if not enabled:
            self._armed = False
        if self._armed:
            self.why_not = ""
        elif self._dead:
            self.why_not = "the buttons went silent; let go of them and press again"
        else:
            self.why_not = "let go of all buttons, and press when the robot is enabled"
        return self._armed


def is_pose(position: Position, wxyz: Quaternion) -> bool:
    """Whether these numbers are a pose of a stylus, in m and of any length but zero."""
    x, y, z = position
    a, b, c, d = wxyz
    norm = a * a + b * b + c * c + d * d
    if not math.isfinite(x + y + z + norm) or norm < SMALLEST_QUATERNION**2:
        return False
    return max(abs(x), abs(y), abs(z)) <= FARTHEST_M
