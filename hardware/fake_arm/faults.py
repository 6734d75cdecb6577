"""What can go wrong with an arm, by name, for tests and demonstrations."""

from __future__ import annotations

from typing import NamedTuple

from hardware.control_channel import BadFault
from robot.errors import UnknownName

_FORM = "give NAME, or NAME:after_ms=5000, or NAME:for_ms=200"


class Fault(NamedTuple):
    """One fault.

    Attributes:
        meaning: what happens.
        error: the controller's error code that it raises; 0 for none.
        lasts: whether it lasts until it is cleared.
    """

    meaning: str
    error: int
    lasts: bool


FAULTS: dict[str, Fault] = {
    "emergency-stop": Fault("the controller's emergency stop is pressed", 1, True),
    "joint-error": Fault("the servo of joint 3 fails", 13, False),
    "collision": Fault("a motor's current tells of a collision", 31, False),
    "self-collision": Fault("the arm is about to touch itself", 22, False),
    "stopped": Fault("somebody else stops the arm", 0, False),
    "drop": Fault("all connections are closed; new ones are taken", 0, False),
    "unplugged": Fault("all connections are closed; new ones are refused", 0, True),
    "silent": Fault("neither answers nor reports come; the connections stay", 0, True),
    "no-reports": Fault("reports stop, answers come", 0, True),
    "slow": Fault("every answer comes 0.2 s late", 0, True),
    "short-answers": Fault("answers come without their data", 0, True),
    "wrong-report": Fault("reports come with a length that cannot be", 0, True),
    "not-a-number": Fault("reports say that joint 2 stands at no number", 0, True),
}
"""Every fault there is."""


class Wanted(NamedTuple):
    """A fault that is asked for: after how long, and for how long (0: until it is cleared)."""

    name: str
    after_ms: float = 0.0
    for_ms: float = 0.0


def wanted_faults(text: str) -> list[Wanted]:
    """Read ``NAME[:after_ms=N][:for_ms=N]``, separated by commas.

    Raises:
        UnknownName: there is no such fault.
        BadFault: what follows a name makes no sense.
    """
    found = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, *options = part.split(":")
        check_name(name)
        numbers = {}
        for option in options:
            key, _, value = option.partition("=")
            try:
                numbers[key] = float(value)
            except ValueError as error:
                raise BadFault(part, _FORM) from error
        if not numbers.keys() <= {"after_ms", "for_ms"} or min(numbers.values(), default=0) < 0:
            raise BadFault(part, _FORM)
        found.append(Wanted(name, **numbers))
    return found


def check_name(name: str) -> None:
    """Raise :class:`UnknownName` unless there is such a fault."""
    if name not in FAULTS:
        raise UnknownName("fault of the arm", name, tuple(FAULTS))
