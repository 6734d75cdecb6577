"""What a stylus' two buttons mean, and whether what was last heard of them still counts.

Source: paper, section 3.1: the buttons drive arm and segment, jointly or each alone.

ROS drivers send buttons in one of two ways. One that *repeats* them shows that it lives: when the
repeats stop, the buttons are dead. One that sends them *on change* is silent while a button is
held, and nothing tells that from a dead one: there a press counts for ``LONGEST_PRESS_S`` only.
"""

from __future__ import annotations

from collections import deque

from robot.configuration import Stylus
from robot.records import DriveMode

LONGEST_PRESS_S = 60.0
"""How long a press counts that nothing repeats."""

_MODES = {"both": DriveMode.BOTH, "arm": DriveMode.ARM, "segment": DriveMode.SEGMENT}
_REPEATS_KNOWN = 3
_LONGEST_REPEAT_NS = 500_000_000
_ALLOWED_REPEATS = 3.0
_SHARE_OF_TIMEOUT = 0.8


class ButtonScheme:
    """Which mode each combination of two buttons means.

    Args:
        configuration: the section ``[stylus]``.
    """

    def __init__(self, configuration: Stylus) -> None:
        names = (
            "none",
            configuration.first_button,
            configuration.second_button,
            configuration.both_buttons,
        )
        self._modes = tuple(_MODES.get(name) for name in names)

    def mode(self, bits: int) -> DriveMode | None:
        """What moves while these are pressed (bit 0 the first); None where nothing does."""
        return self._modes[bits & 3]


class ButtonWatch:
    """The newest state of the buttons, and until when it counts. Times in ns, one clock.

    Args:
        timeout_ns: within which control shall know that they are dead.

    Attributes:
        bits: the newest state.
        heard_ns: when it was last heard.
        repeats: whether the driver repeats what has not changed.
    """

    def __init__(self, timeout_ns: int) -> None:
        self._timeout_ns = timeout_ns
        self._gaps: deque[int] = deque(maxlen=8)
        self.bits, self.heard_ns, self.repeats = 0, 0, False

    def heard(self, bits: int, now_ns: int) -> None:
        """The buttons were told."""
        gap = now_ns - self.heard_ns
        if self.heard_ns and bits == self.bits and gap <= _LONGEST_REPEAT_NS:
            self._gaps.append(gap)
            self.repeats = self.repeats or len(self._gaps) >= _REPEATS_KNOWN
        self.bits, self.heard_ns = bits, now_ns

    def are_dead(self, now_ns: int) -> bool:
        """Whether a press no longer counts, because nothing says that it goes on."""
        if self.bits == 0:
            return False
        silent_ns = now_ns - self.heard_ns
        if self.repeats:
            # Early enough for control to know of it within the time-out.
            shortest_ns = _SHARE_OF_TIMEOUT * self._timeout_ns
            return silent_ns > max(shortest_ns, _ALLOWED_REPEATS * max(self._gaps))
        return silent_ns > LONGEST_PRESS_S * 1e9
