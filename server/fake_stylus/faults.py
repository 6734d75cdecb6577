"""What can go wrong with a stylus, by name."""

from __future__ import annotations

from dataclasses import dataclass

from hardware.control_channel import BadFault
from robot.errors import UnknownName


@dataclass(frozen=True)
class Known:
    """One fault that can be injected.

    Attributes:
        times: how many samples it strikes where nothing else is asked for; 0 until it is cleared.
        meaning: in words, for the help.
    """

    times: int
    meaning: str


KNOWN = {
    "stale": Known(0, "nothing is sent any more; the connection stays"),
    "drop-out": Known(1, "the connection breaks; none is taken for delay_ms (1000)"),
    "late": Known(0, "everything arrives delay_ms (100) late, in order"),
    "out-of-order": Known(5, "samples bear a stamp of 20 ms ago"),
    "repeated-stamp": Known(0, "the stamps of the poses stand still, the poses go on"),
    "nan": Known(1, "a coordinate is NaN"),
    "null": Known(1, "a coordinate is null, as some bridges write NaN"),
    "infinity": Known(1, "a coordinate is infinite"),
    "zero-quaternion": Known(1, "the orientation is 0, 0, 0, 0"),
    "negated-quaternion": Known(0, "every second orientation is -q, which is the same as q"),
    "teleport": Known(0, "the stylus is elsewhere by value mm (100)"),
    "buttons-dead": Known(0, "buttons are not told any more; poses go on"),
    "buttons-frozen": Known(0, "buttons are told with a stamp that stands still"),
    "malformed": Known(1, "a message is no JSON"),
    "oversized": Known(1, "a message is far too long"),
    "wrong-topic": Known(1, "a message of a topic that nobody asked for"),
    "wrong-type": Known(1, "a message of the right topic and the wrong type"),
}
"""Every fault by its name."""

_KEYS = ("times", "delay_ms", "value", "for_ms")
_DEFAULT_DELAY_MS = {"drop-out": 1000.0, "late": 100.0}
_TELEPORT_MM = 100.0


@dataclass
class Fault:
    """A fault that is in force.

    Attributes:
        name: see :data:`KNOWN`.
        times: how many samples it still strikes; 0 until it is cleared.
        delay_ms: see :data:`KNOWN`.
        value: likewise.
        until_ns: when it ends by itself, 0 for never.
        began_ns: when it first struck, 0 before.
        struck: how often it has.
    """

    name: str
    times: int
    delay_ms: float
    value: float
    until_ns: int = 0
    began_ns: int = 0
    struck: int = 0

    def as_dict(self) -> dict[str, object]:
        """For the control channel."""
        return {"name": self.name, "began_ns": self.began_ns, "struck": self.struck}


def make(name: str, options: dict[str, object], now_ns: int) -> Fault:
    """A fault of that name.

    Raises:
        UnknownName: there is none of that name.
        BadFault: an option makes no sense.
    """
    if name not in KNOWN:
        raise UnknownName("fault", name, tuple(KNOWN))
    numbers: dict[str, float] = {}
    for key, value in options.items():
        try:
            number = float(str(value))
        except ValueError:
            number = -1.0
        if key not in _KEYS or not 0.0 <= number < 1e6:
            raise BadFault(name, f"{key}={value} makes no sense; keys are {', '.join(_KEYS)}")
        numbers[key] = number
    for_ms = numbers.get("for_ms", 0.0)
    return Fault(
        name,
        int(numbers.get("times", KNOWN[name].times)),
        numbers.get("delay_ms", _DEFAULT_DELAY_MS.get(name, 0.0)),
        numbers.get("value", _TELEPORT_MM),
        now_ns + round(for_ms * 1e6) if for_ms else 0,
    )


def parse(text: str, now_ns: int) -> list[Fault]:
    """Faults from the command line: NAME[:KEY=VALUE]..., separated by commas.

    Raises:
        UnknownName: there is no such fault.
        BadFault: an option makes no sense.
    """
    faults = []
    for part in filter(None, text.split(",")):
        name, *pairs = part.strip().split(":")
        options: dict[str, object] = dict(pair.partition("=")[::2] for pair in pairs)
        faults.append(make(name, options, now_ns))
    return faults


class Faults:
    """The faults in force."""

    def __init__(self) -> None:
        self.active: dict[str, Fault] = {}

    def add(self, fault: Fault) -> None:
        """Let a fault happen from the next sample on; one of the same name is replaced."""
        self.active[fault.name] = fault

    def clear(self, name: str | None) -> list[str]:
        """End a fault, or all; returns the names of those that ended."""
        names = [known for known in self.active if name is None or known == name]
        for known in names:
            del self.active[known]
        return names

    def strikes(self, name: str, now_ns: int) -> Fault | None:
        """The fault of that name where it strikes the sample of now."""
        fault = self.active.get(name)
        if fault is None:
            return None
        if fault.until_ns and now_ns >= fault.until_ns:
            del self.active[name]
            return None
        fault.began_ns = fault.began_ns or now_ns
        fault.struck += 1
        if fault.times and fault.struck >= fault.times:
            del self.active[name]
        return fault
