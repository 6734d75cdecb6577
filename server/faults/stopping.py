"""The measure of every fault that must stop the robot."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from robot.records import Safety
from robot.safety import REASONS, Event
from server.faults.bench import Bench
from server.faults.fault import Fault, Finding
from server.faults.watching import (
    Records,
    after,
    commanded_path_mm,
    reach_mm,
    reason,
    safety,
    stands_still,
)

NOTICE_S = 8.0
LOOK_S = 1.0
_ATTEMPTS = 4
_SLACK_NS = 1_000_000


def stopped(bench: Bench, fault: Fault) -> Finding:
    """Drive, inject, and look: noticed when, gone how far, moved by itself, driven again?

    What intervenes on a busy machine (a leader's sample that comes late stops the robot too, as it
    should) is no finding about this fault: it is injected again.
    """
    finding = Finding()
    for attempt in range(1, _ATTEMPTS + 1):
        bench.arm()
        bench.watch.mark()
        began_ns = fault.begin(bench)
        place = bench.watch.until(_left_enabled, NOTICE_S)
        finding = Finding(attempts=attempt)
        if place is None:
            finding.message = "nothing noticed it"
            fault.mend(bench)
            return finding
        first = bench.watch.records()[place : place + 1]
        if Event(int(reason(first)[0])) in fault.events and stamp(first) >= began_ns - _SLACK_NS:
            break
        fault.mend(bench)
        finding.message = f"another cause came first: {REASONS[Event(int(reason(first)[0]))][0]}"
    else:
        return finding
    describe(bench, finding, place, began_ns)
    afterwards(bench, fault, finding)
    return finding


def deviates(
    bench: Bench,
    fault: Fault,
    begin: Callable[[], int],
    exceeds: Callable[[Bench], NDArray[np.bool_]],
) -> Finding:
    """As :func:`stopped` for what cannot be noticed before something deviates too far.

    Args:
        bench: drives.
        fault: what is to be noticed, and mended.
        begin: injects it; when, ns.
        exceeds: for every record that was seen: whether the deviation is past its limit.
    """
    bench.arm()
    bench.watch.mark()
    began_ns = begin()
    place = bench.watch.until(_left_enabled, NOTICE_S)
    finding = Finding()
    if place is None:
        fault.mend(bench)
        finding.message = "nothing noticed it"
        return finding
    first = bench.watch.records()[place : place + 1]
    why = Event(int(reason(first)[0]))
    if why not in fault.events:
        fault.mend(bench)
        finding.message = f"another cause came first: {REASONS[why][0]}"
        return finding
    passed = np.flatnonzero(exceeds(bench)[: place + 1])
    onset = bench.watch.records()[passed[0] : passed[0] + 1] if len(passed) else None
    describe(bench, finding, place, stamp(onset) if onset is not None else began_ns)
    finding.remark = (
        f"counted from the deviation passing its limit, {(stamp(first) - began_ns) * 1e-6:.0f} ms "
        f"after it began"
    )
    afterwards(bench, fault, finding)
    return finding


def _left_enabled(records: Records) -> NDArray[np.bool_]:
    return np.asarray(safety(records) != Safety.ENABLED)


def stamp(record: Records) -> int:
    """When a (1,) record was published, ns."""
    return int(record["header"]["stamp_ns"][0])


def describe(bench: Bench, finding: Finding, place: int, began_ns: int) -> None:
    """Fill in what the records say, ``place`` being the first that shows the fault."""
    time.sleep(LOOK_S)
    records = bench.watch.records()
    first = records[place : place + 1]
    second = after(records, max(0, place - 1), LOOK_S)
    words, action = REASONS[Event(int(reason(first)[0]))]
    finding.detected = True
    finding.detected_within_ms = max(0.0, (stamp(first) - began_ns) * 1e-6)
    finding.state = Safety(int(safety(first)[0])).name
    finding.commanded_travel_mm = commanded_path_mm(second)
    finding.coast_mm = reach_mm(second)
    finding.message = f"{words}; {action}"


def afterwards(bench: Bench, fault: Fault, finding: Finding) -> None:
    """Take the cause away, look whether anything moves by itself, then recover by hand."""
    fault.mend(bench)
    bench.watch.mark()
    time.sleep(LOOK_S)
    records = bench.watch.records()
    finding.stayed_stopped = stands_still(records) and commanded_path_mm(records) < 1e-3
    recovered(bench, finding)


def recovered(bench: Bench, finding: Finding) -> None:
    """Recover by hand, and see whether the robot is driven again."""
    finding.recovery = bench.recover()
    finding.recovered = bench.drives()
    if not finding.recovered:
        # What stops it now is not this fault any more: a person would try once more.
        bench.recover()
        finding.recovered = bench.drives()
