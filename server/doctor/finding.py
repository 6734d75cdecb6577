"""One thing that was looked at: how it is, what that means, and what to do about it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any


class Level(StrEnum):
    """How a finding is to be taken."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True)
class Finding:
    """What was found.

    Attributes:
        area: what was looked at, in a word or two.
        level: how bad it is.
        what: what was seen, with its numbers.
        meaning: what that leads to; empty where all is well.
        advice: what to do; empty where all is well.
        data: the numbers, for programs; units in the names.
    """

    area: str
    level: Level
    what: str
    meaning: str = ""
    advice: str = ""
    data: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def fine(area: str, what: str, **data: Any) -> Finding:
    """A finding that needs nobody's attention."""
    return Finding(area, Level.OK, what, data=data)


def warning(area: str, what: str, meaning: str, advice: str, **data: Any) -> Finding:
    """A finding that one can work with."""
    return Finding(area, Level.WARN, what, meaning, advice, data)


def failure(area: str, what: str, meaning: str, advice: str, **data: Any) -> Finding:
    """A finding that the robot will not work with."""
    return Finding(area, Level.FAIL, what, meaning, advice, data)
