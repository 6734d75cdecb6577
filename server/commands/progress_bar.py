"""A progress bar on the terminal: what is done, how far it is, how long it will take."""

from __future__ import annotations

import sys
import time

_WIDTH = 30


def clock(seconds: float) -> str:
    """Seconds as people read them: ``0:07``, ``12:30``, ``1:02:30``."""
    whole = round(seconds)
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes}:{rest:02d}"
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"


def bar(title: str, share: float, elapsed_s: float) -> str:
    """One line: title, bar, share, and the time that remains if it goes on like this.

    Args:
        title: what is being done.
        share: how much of it is done, 0 to 1.
        elapsed_s: how long that took, s.
    """
    filled = round(share * _WIDTH)
    left = clock(elapsed_s * (1.0 - share) / share) if share > 0.0 else "-:--"
    drawn = "#" * filled + "." * (_WIDTH - filled)
    return f"{title} [{drawn}] {100 * share:3.0f} %, {left} left"


class ProgressBar:
    """Draws on stderr where somebody looks, and nothing elsewhere.

    Attributes:
        title: what is being done.
    """

    _EVERY_S = 0.1

    def __init__(self, title: str) -> None:
        self.title = title
        self._drawn = 0
        self._seen = sys.stderr.isatty()
        self._started = time.monotonic()
        self._newest = 0.0

    def __call__(self, share: float) -> None:
        """Draw that ``share`` (0 to 1) is done."""
        now = time.monotonic()
        if not self._seen or (now - self._newest < self._EVERY_S and share < 1.0):
            return
        self._newest = now
        line = bar(self.title, share, now - self._started)
        print(f"\r{line:<{self._drawn}}", end="", file=sys.stderr, flush=True)
        self._drawn = len(line)

    def end(self) -> None:
        """Leave the line."""
        if self._drawn:
            print(file=sys.stderr)
            self._drawn = 0
