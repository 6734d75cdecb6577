"""Faults of a haptic stylus and its rosbridge, injected into the simulated one."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from hardware.fake_servos.client import FakeServos
from robot.records import Safety
from robot.safety import Event
from server.faults.bench import Bench
from server.faults.demands import BenchFailed, Deadline
from server.faults.fault import Fault, Finding, Group
from server.faults.stopping import LOOK_S, stopped
from server.faults.watching import safety

_STALE = (Event.LEADER_STALE,)
_INVALID = (Event.LEADER_INVALID, Event.LEADER_STALE)
_JUMP = (Event.LEADER_JUMP,)


def _stylus(bench: Bench) -> FakeServos:
    if bench.stylus is None:
        raise BenchFailed("there is no stylus here")
    return bench.stylus


def _inject(name: str, **options: float) -> Callable[[Bench], int]:
    return lambda bench: _stylus(bench).inject(name, **options)


def _clear(bench: Bench) -> None:
    _stylus(bench).clear()


def _stopping(
    name: str, title: str, injected: str, events: tuple[Event, ...], **options: float
) -> Fault:
    return Fault(
        name,
        Group.INPUT,
        title,
        stopped,
        Deadline.LEADER,
        begin=_inject(injected, **options),
        mend=_clear,
        events=events,
        state=Safety.PAUSED,
        needs="hardware",
    )


def _counted(injected: str, counter: str) -> Callable[[Bench, Fault], Finding]:
    """What can be put right is: the robot goes on, and it is counted."""

    def measure(bench: Bench, _fault: Fault) -> Finding:
        bench.arm()
        bench.watch.mark()
        before = bench.stylus_count(counter) if counter else 0
        began_ns = _stylus(bench).inject(injected)
        time.sleep(LOOK_S)
        records = bench.watch.records()
        after = bench.stylus_count(counter) if counter else 0
        _clear(bench)
        wxyz = records["outcome"]["report"]["commanded_wxyz"]
        along = np.abs((wxyz[1:] * wxyz[:-1]).sum(axis=1)).clip(0.0, 1.0)
        turned_deg = float(np.degrees(2.0 * np.arccos(along)).max())
        given = records["input"]["leader"]["wxyz"]
        flips = np.flatnonzero((given[1:] * given[:-1]).sum(axis=1) < 0.0)
        goes_on = bool((safety(records) == Safety.ENABLED).all())
        finding = Finding(tolerated=True, state=bench.now()[0].name, detected_within_ms=0.0)
        counted = after > before if counter else len(flips) > 0
        finding.detected = goes_on and counted and turned_deg < 1.0
        words = f"{counter} +{after - before}" if counter else f"{len(flips)} changes of sign"
        finding.counter = f"{words}, largest turn of the tip in a tick {turned_deg:.3f} deg"
        if not counter and len(flips):
            stamps = records["header"]["stamp_ns"]
            finding.detected_within_ms = max(0.0, float(stamps[flips[0] + 1] - began_ns) * 1e-6)
        finding.message = "the robot goes on"
        finding.recovered = bench.drives()
        return finding

    return measure


def _tolerated(name: str, title: str, injected: str, counter: str) -> Fault:
    return Fault(
        name,
        Group.INPUT,
        title,
        _counted(injected, counter),
        Deadline.LEADER,
        mend=_clear,
        needs="hardware",
    )


STYLUS_FAULTS = (
    _stopping("stylus-stale", "The stylus goes silent", "stale", _STALE),
    _tolerated("stylus-out-of-order", "Samples come out of order", "out-of-order", "out_of_order"),
    _stopping("stylus-repeated-stamp", "Time stamps stand still", "repeated-stamp", _STALE),
    _stopping("stylus-late", "Samples come 100 ms late", "late", _STALE),
    _stopping("stylus-nan", "A coordinate is NaN", "nan", _INVALID),
    _stopping("stylus-null", "A coordinate is null", "null", _INVALID),
    _stopping("stylus-infinity", "A coordinate is infinite", "infinity", _INVALID),
    _stopping("stylus-zero-quaternion", "A zero quaternion", "zero-quaternion", _INVALID),
    _tolerated("stylus-sign-of-quaternion", "q becomes -q and back", "negated-quaternion", ""),
    _stopping("stylus-teleport", "The stylus jumps by 100 mm", "teleport", _JUMP),
    _stopping("stylus-drop-out", "The connection breaks with a button held", "drop-out", _STALE),
    _stopping("stylus-buttons-dead", "Buttons go silent, poses go on", "buttons-dead", _STALE),
    _tolerated("stylus-malformed", "A message is no JSON", "malformed", "malformed"),
    _tolerated("stylus-oversized", "A message is far too long", "oversized", "oversized"),
    _tolerated("stylus-wrong-topic", "A message of another topic", "wrong-topic", "wrong_topic"),
)
