"""The terminal in which a console runs: Enter stops the robot, whatever the page does."""

from __future__ import annotations

import os
import signal
import sys

_AT_ONCE = 1024


class Terminal:
    """Reads the terminal's lines while the console is in its foreground. Never waits.

    Args:
        descriptor: of the input; None for none. What is no terminal is not read.
    """

    def __init__(self, descriptor: int | None) -> None:
        self._descriptor = descriptor
        if descriptor is None or not os.isatty(descriptor):
            self._descriptor = None
            return
        # Reading from the background would stop the whole console.
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)

    @classmethod
    def of_this_process(cls) -> Terminal:
        """The standard input, if there is one."""
        try:
            return cls(sys.stdin.fileno())
        except (AttributeError, OSError, ValueError):
            return cls(None)

    @property
    def is_there(self) -> bool:
        """Whether somebody can press a key in it."""
        return self._descriptor is not None

    def descriptors(self) -> list[int]:
        """What to wait for: the terminal where it is ours to read, else nothing."""
        if self._descriptor is None or not self._is_in_front(self._descriptor):
            return []
        return [self._descriptor]

    @staticmethod
    def _is_in_front(descriptor: int) -> bool:
        try:
            return os.tcgetpgrp(descriptor) == os.getpgrp()
        except OSError:
            # Not the terminal that controls this process: nobody else reads it.
            return True

    def pressed(self) -> bool:
        """Take what was typed; True if a line was: Enter alone, or anything before it."""
        if self._descriptor is None:
            return False
        try:
            typed = os.read(self._descriptor, _AT_ONCE)
        except OSError:
            typed = b""
        if not typed:
            # The end of the input, or a terminal that was closed.
            self._descriptor = None
        return bool(typed)
