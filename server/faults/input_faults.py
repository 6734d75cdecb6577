"""Faults of the leader's wire, as a program or device on the console's stream commits them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from robot.records import Safety
from robot.safety import Event
from server.faults.bench import Bench
from server.faults.demands import Deadline
from server.faults.fault import Fault, Finding, Group
from server.faults.leading import Sample, Tamper
from server.faults.stopping import LOOK_S, stopped
from server.faults.watching import safety

_TELEPORT_MM = 120.0
_DRIVEN = (Event.LEADER_STALE, Event.LEADER_INVALID, Event.LEADER_JUMP)
_GONE = (Event.LEADER_STALE, Event.OPERATOR_LOST)
_FIRST_S = 1.0


def _begin(how: Tamper) -> Callable[[Bench], int]:
    """Tamper with every sample from the next one on; the fault begins with that one."""

    def begin(bench: Bench) -> int:
        bench.page.tamper(how)
        bench.wait(lambda: bench.page.tampered_ns > 0, "the next sample", _FIRST_S)
        return bench.page.tampered_ns

    return begin


def _mend(bench: Bench) -> None:
    bench.page.tamper(None)


def _silent(_sample: Sample, _count: int) -> Sample | None:
    return None


def _with(**values: Any) -> Tamper:
    return lambda sample, _: {**sample, **values}


def _teleported(sample: Sample, _count: int) -> Sample:
    x, y, z = sample["position_mm"]
    return {**sample, "position_mm": [x + _TELEPORT_MM, y, z]}


def _other_sign(sample: Sample, count: int) -> Sample:
    sign = -1.0 if count % 2 else 1.0
    return {**sample, "orientation_wxyz": [sign * one for one in sample["orientation_wxyz"]]}


def _stopping(name: str, title: str, how: Tamper, events: tuple[Event, ...] = _DRIVEN) -> Fault:
    return Fault(
        name,
        Group.INPUT,
        title,
        stopped,
        Deadline.LEADER,
        begin=_begin(how),
        mend=_mend,
        events=events,
        state=Safety.PAUSED,
    )


def _both_signs(bench: Bench, fault: Fault) -> Finding:
    """Both q and -q are the same orientation: the robot goes on, and the tip does not turn."""
    bench.arm()
    bench.watch.mark()
    began_ns = fault.begin(bench)
    time.sleep(LOOK_S)
    records = bench.watch.records()
    wxyz = records["outcome"]["report"]["commanded_wxyz"]
    along = np.abs((wxyz[1:] * wxyz[:-1]).sum(axis=1)).clip(0.0, 1.0)
    turned_deg = float(np.degrees(2.0 * np.arccos(along)).max())
    fault.mend(bench)
    newest = records["input"]["leader"]["wxyz"]
    flips = int(((newest[1:] * newest[:-1]).sum(axis=1) < 0.0).sum())
    goes_on = bool((safety(records) == Safety.ENABLED).all())
    finding = Finding(tolerated=True, state=bench.now()[0].name)
    finding.detected = goes_on and flips > 0 and turned_deg < 1.0
    stamps = records["header"]["stamp_ns"]
    at = np.flatnonzero((newest[1:] * newest[:-1]).sum(axis=1) < 0.0)
    if len(at):
        finding.detected_within_ms = max(0.0, float(stamps[at[0] + 1] - began_ns) * 1e-6)
    finding.counter = f"{flips} changes of sign, largest turn of the tip in a tick {turned_deg:.3f}"
    finding.message = "taken as the same orientation"
    finding.recovered = bench.drives()
    return finding


def _wrong_scale(value: float) -> Callable[[Bench, Fault], Finding]:
    def measure(bench: Bench, _fault: Fault) -> Finding:
        bench.arm()
        before = bench.api.state()["teleoperation"]["motion_scale"]
        bench.watch.mark()
        asked_ns = time.monotonic_ns()
        answer = bench.api.call("PUT", "/teleoperation", {"motion_scale": value})
        answered_ms = (time.monotonic_ns() - asked_ns) * 1e-6
        time.sleep(0.2)
        kept = bench.watch.records()["input"]["settings"]["motion_scale"]
        finding = Finding(tolerated=True, state=bench.now()[0].name)
        finding.detected = 400 <= answer.status < 500 and bool((kept == before).all())
        finding.detected_within_ms = answered_ms
        finding.message = str(answer.body.get("detail", ""))
        finding.counter = f"refused with {answer.status}"
        finding.recovered = bench.drives()
        return finding

    return measure


def _scale(name: str, title: str, value: float) -> Fault:
    return Fault(name, Group.INPUT, title, _wrong_scale(value), Deadline.ANSWER)


_ZERO, _NAN = [0.0, 0.0, 0.0, 0.0], [math.nan, 0.0, 0.0]

INPUT_FAULTS = (
    _stopping("leader-silent", "A program's samples stop coming", _silent, (Event.LEADER_STALE,)),
    _stopping("leader-nan", "A sample holds NaN", _with(position_mm=_NAN)),
    _stopping("leader-infinite", "A sample holds infinity", _with(position_mm=[math.inf, 0, 0])),
    _stopping("leader-zero-quaternion", "A zero quaternion", _with(orientation_wxyz=_ZERO)),
    _stopping("leader-no-pose", "A sample without a pose", _with(position_mm=None)),
    _stopping("leader-teleport", "The leader jumps by 120 mm", _teleported, (Event.LEADER_JUMP,)),
    Fault(
        "leader-drop-out",
        Group.INPUT,
        "A program's connection is cut with its clutch closed",
        stopped,
        Deadline.LEADER,
        begin=lambda bench: bench.page.cut(),
        events=_GONE,
        state=Safety.PAUSED,
    ),
    Fault(
        "leader-sign-of-quaternion",
        Group.INPUT,
        "Quaternions change their sign from sample to sample",
        _both_signs,
        Deadline.LEADER,
        begin=_begin(_other_sign),
        mend=_mend,
    ),
    _scale("motion-scale-zero", "Motion scale 0", 0.0),
    _scale("motion-scale-negative", "Motion scale -1", -1.0),
    _scale("motion-scale-infinite", "Motion scale infinity", math.inf),
)
