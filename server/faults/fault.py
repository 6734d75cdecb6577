"""What a fault is, what is demanded of the console, and what was found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

from robot.records import Safety
from robot.safety import Event
from server.faults.demands import Deadline

if TYPE_CHECKING:
    from server.faults.bench import Bench

TRAVEL_LIMIT_MM = 0.1
"""How far the commanded tip may go after a fault was noticed."""


class Group(Enum):
    """Where a fault strikes."""

    BUS = "bus"
    INPUT = "input"
    CONTROL = "control"
    SYSTEM = "system"


@dataclass
class Finding:
    """What one fault led to.

    Attributes:
        detected: whether anything noticed it.
        detected_within_ms: from its beginning to the first record that shows it.
        state: of the robot then.
        commanded_travel_mm: way of the commanded tip in the second after that.
        coast_mm: how far the tip still went in that second.
        message: what a person reads.
        stayed_stopped: whether nothing moved by itself once the cause was gone.
        recovery: what a person did then: endpoints of the API in this order.
        recovered: whether it drove again after that.
        tolerated: whether the robot goes on by design, the fault being counted.
        counter: what counted it.
        remark: what else there is to know.
        attempts: how often it was injected; more than once where something else intervened.
    """

    detected: bool = False
    detected_within_ms: float | None = None
    state: str = ""
    commanded_travel_mm: float | None = None
    coast_mm: float | None = None
    message: str = ""
    stayed_stopped: bool | None = None
    recovery: tuple[str, ...] = ()
    recovered: bool | None = None
    tolerated: bool = False
    counter: str = ""
    remark: str = ""
    attempts: int = 1


@dataclass(frozen=True)
class Fault:
    """One fault of the table.

    Attributes:
        name: stable, for programs.
        group: where it strikes.
        title: for people.
        measure: injects it, and finds out.
        deadline: within which it must be noticed.
        begin: injects it; the monotonic time in ns at which it began.
        mend: takes the cause away.
        events: any of these is noticing it.
        state: where it must lead; None for nowhere.
        needs: what must be there beside the console.
    """

    name: str
    group: Group
    title: str
    measure: Callable[[Bench, Fault], Finding]
    deadline: Deadline = Deadline.LEADER
    begin: Callable[[Bench], int] = field(default=lambda _: 0)
    mend: Callable[[Bench], None] = field(default=lambda _: None)
    events: tuple[Event, ...] = ()
    state: Safety | None = None
    needs: str = "simulated"


def is_met(finding: Finding, limit_ms: float) -> bool:
    """Whether the finding is all that is demanded."""
    in_time = finding.detected_within_ms is not None and finding.detected_within_ms <= limit_ms
    travel = finding.commanded_travel_mm
    still = finding.tolerated or travel is None or travel <= TRAVEL_LIMIT_MM
    after = finding.stayed_stopped is not False and finding.recovered is not False
    return finding.detected and in_time and still and after


def row(fault: Fault, finding: Finding, limit_ms: float) -> dict[str, Any]:
    """The fault's entry of the table."""

    def rounded(value: float | None) -> float | None:
        return None if value is None else round(value, 3)

    return {
        "fault": fault.name,
        "group": fault.group.value,
        "title": fault.title,
        "detected": finding.detected,
        "detected_within_ms": rounded(finding.detected_within_ms),
        "limit_ms": rounded(limit_ms),
        "limit": fault.deadline.value,
        "state": finding.state,
        "commanded_travel_mm": rounded(finding.commanded_travel_mm),
        "coast_mm": rounded(finding.coast_mm),
        "message": finding.message,
        "recovery": ", then ".join(finding.recovery) or "none needed",
        "stayed_stopped": finding.stayed_stopped,
        "recovered": finding.recovered,
        "tolerated": finding.tolerated,
        "counter": finding.counter,
        "remark": finding.remark,
        "attempts": finding.attempts,
        "met": is_met(finding, limit_ms),
    }
