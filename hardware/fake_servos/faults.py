"""What can go wrong with a bus, by name: what is wrong, with which servo, and for how long.

A fault of a reply or of an instruction happens a number of times and is used up; a condition
lasts until it is cleared or its time is over.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from hardware.control_channel import BadFault
from robot.errors import UnknownName


class Kind(Enum):
    """What a fault strikes."""

    REPLY = "an answer on its way to the host"
    INSTRUCTION = "an instruction on its way to the servos"
    CONDITION = "a servo"
    ACT = "the port, at once"


@dataclass(frozen=True)
class Known:
    """One fault that can be injected.

    Attributes:
        kind: what it strikes.
        times: how often it happens where nothing else is asked for; 0 until it is cleared.
        meaning: in words, for the help.
    """

    kind: Kind
    times: int
    meaning: str


KNOWN = {
    "unplug": Known(Kind.ACT, 1, "the port hangs up"),
    "unplug-reading": Known(Kind.REPLY, 1, "the port hangs up in the middle of an answer"),
    "unplug-writing": Known(Kind.INSTRUCTION, 1, "the port hangs up while the host writes"),
    "another-name": Known(Kind.ACT, 1, "the port hangs up and comes back under another name"),
    "crc-flip": Known(Kind.REPLY, 1, "one bit of an answer is wrong"),
    "truncated": Known(Kind.REPLY, 1, "an answer ends in the middle"),
    "wrong-id": Known(Kind.REPLY, 1, "an answer bears the id of nobody"),
    "duplicate": Known(Kind.REPLY, 1, "an answer comes twice"),
    "late": Known(Kind.REPLY, 1, "an answer comes delay_ms too late"),
    "timeouts": Known(Kind.REPLY, 5, "answers do not come"),
    "overload": Known(Kind.CONDITION, 0, "a servo finds itself overloaded and lets torque go"),
    "overheat": Known(Kind.CONDITION, 0, "a servo is at value °C (80)"),
    "voltage": Known(Kind.CONDITION, 0, "a servo gets value V (5)"),
    "silent": Known(Kind.CONDITION, 0, "a servo hears and says nothing"),
    "encoder-stuck": Known(Kind.CONDITION, 0, "a servo reads the same position for ever"),
    "reversed": Known(Kind.CONDITION, 0, "a servo turns the other way than it should"),
}
"""Every fault by its name."""


@dataclass
class Fault:
    """One fault that was injected.

    Attributes:
        name: key of :data:`KNOWN`.
        servo: id of the servo that it strikes; None for whichever comes (a condition: the first).
        times: how often it will still happen; 0 until it is cleared.
        after: how many chances it lets pass before.
        delay_ms: how late "late" is, and after which time another name appears.
        for_ms: after which time it is over; 0 for never.
        value: of "voltage" and "overheat".
        begun_ns: when it was injected.
        acted: how often it has happened.
        first_ns: when for the first time; 0 for not yet.
        last_ns: when for the last time.
        over: whether it is used up or cleared.
    """

    name: str
    servo: int | None = None
    times: int = 1
    after: int = 0
    delay_ms: float = 20.0
    for_ms: float = 0.0
    value: float | None = None
    begun_ns: int = 0
    acted: int = 0
    first_ns: int = 0
    last_ns: int = 0
    over: bool = False

    @property
    def kind(self) -> Kind:
        """What it strikes."""
        return KNOWN[self.name].kind

    def happens(self, now_ns: int) -> None:
        """Count it."""
        self.acted += 1
        self.first_ns = self.first_ns or now_ns
        self.last_ns = now_ns
        if self.times:
            self.times -= 1
            self.over = self.times == 0

    def as_dict(self) -> dict[str, Any]:
        """For the control channel."""
        return {
            key: getattr(self, key)
            for key in ("name", "servo", "times", "begun_ns", "acted", "first_ns", "last_ns")
        } | {"over": self.over}


_NUMBERS = {"servo": int, "times": int, "after": int}
_REALS = {"delay_ms": float, "for_ms": float, "value": float}


def make(name: str, options: dict[str, Any], ids: Iterable[int], now_ns: int) -> Fault:
    """A fault from its name and options.

    Args:
        name: key of :data:`KNOWN`.
        options: of ``servo, times, after, delay_ms, for_ms, value``; numbers or their text.
        ids: of the servos that exist.
        now_ns: monotonic clock.

    Raises:
        UnknownName: there is no such fault.
        BadFault: an option that it does not have, or no servo of this id.
    """
    if name not in KNOWN:
        raise UnknownName("fault", name, tuple(KNOWN))
    fault = Fault(name, times=KNOWN[name].times, begun_ns=now_ns)
    for key, given in options.items():
        if key not in _NUMBERS | _REALS:
            known = ", ".join((*_NUMBERS, *_REALS))
            raise BadFault(name, f"has no option {key!r}; choose one of: {known}")
        try:
            value = _NUMBERS[key](given) if key in _NUMBERS else float(given)
        except (TypeError, ValueError):
            raise BadFault(name, f"{key} = {given!r} is no number") from None
        if value < 0:
            raise BadFault(name, f"{key} = {given!r} must not be negative")
        setattr(fault, key, value)
    if fault.servo is not None and fault.servo not in set(ids):
        raise BadFault(name, f"there is no servo {fault.servo}")
    return fault


def parse(text: str, ids: Iterable[int], now_ns: int) -> list[Fault]:
    """Faults as the command line names them: ``NAME[:KEY=VALUE]...[,NAME...]``.

    Raises:
        UnknownName: there is no such fault.
        BadFault: an option makes no sense.
    """
    faults = []
    for part in filter(None, text.split(",")):
        name, *pairs = part.strip().split(":")
        options = {}
        for pair in pairs:
            key, equals, value = pair.partition("=")
            if not equals:
                raise BadFault(name, f"{pair!r} is not KEY=VALUE")
            options[key] = value
        faults.append(make(name, options, ids, now_ns))
    return faults


class Faults:
    """The faults of one bus, in the order in which they were injected."""

    def __init__(self) -> None:
        self.all: list[Fault] = []

    def add(self, fault: Fault) -> None:
        """Inject one."""
        self.all.append(fault)

    def pick(self, kind: Kind, ids: Iterable[int], now_ns: int) -> Fault | None:
        """The fault that strikes now, if any; it counts as having happened.

        Args:
            kind: what it would strike.
            ids: servos that would be struck.
            now_ns: monotonic clock.
        """
        if not self.all:
            return None
        concerned = set(ids)
        for fault in self.all:
            if fault.over or fault.kind is not kind:
                continue
            if fault.servo is not None and fault.servo not in concerned:
                continue
            if fault.after:
                fault.after -= 1
                continue
            fault.happens(now_ns)
            return fault
        return None

    def expired(self, now_ns: int) -> list[Fault]:
        """Those whose time is over and that have not been cleared."""
        return [
            fault
            for fault in self.all
            if fault.for_ms
            and not fault.over
            and now_ns - fault.begun_ns >= fault.for_ms * 1_000_000
        ]

    def named(self, name: str | None) -> list[Fault]:
        """All that are not over, or those of one name."""
        return [fault for fault in self.all if not fault.over and name in {None, fault.name}]
