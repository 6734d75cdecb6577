"""Faults of the servo bus, injected into the simulated servos while a console drives them."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hardware.fake_servos.client import FakeServos
from robot.records import Readiness, Safety
from robot.safety import Event
from server.faults.bench import Bench
from server.faults.demands import BenchFailed, Deadline
from server.faults.fault import Fault, Finding, Group
from server.faults.stopping import (
    LOOK_S,
    NOTICE_S,
    afterwards,
    describe,
    recovered,
    stamp,
    stopped,
)
from server.faults.watching import Records, commanded_path_mm, safety, stands_still

_LOST = (Event.BUS_LOST, Event.SERVO_SILENT, Event.MEASUREMENT_LOST)
_SERVO = 102
_BURST = 40
_SETTLE_S = 0.3
_WATCHDOG_LOOK_S = 0.5


def _servos(bench: Bench) -> FakeServos:
    if bench.servos is None:
        raise BenchFailed("there is no servo bus here")
    return bench.servos


def _inject(name: str, **options: float) -> Callable[[Bench], int]:
    return lambda bench: _servos(bench).inject(name, **options)


def _clear(bench: Bench) -> None:
    _servos(bench).clear()


def _replug(bench: Bench) -> None:
    _servos(bench).clear()
    _servos(bench).replug()


def _stopping(
    name: str,
    title: str,
    begin: Callable[[Bench], int],
    events: tuple[Event, ...],
    state: Safety,
    mend: Callable[[Bench], None] = _clear,
) -> Fault:
    return Fault(
        name,
        Group.BUS,
        title,
        stopped,
        Deadline.BUS,
        begin=begin,
        mend=mend,
        events=events,
        state=state,
        needs="hardware",
    )


def _counted(injected: str, counter: str, **options: float) -> Callable[[Bench, Fault], Finding]:
    """One bad answer is no reason to stop: it is counted, and the next cycle makes up for it."""

    def measure(bench: Bench, _fault: Fault) -> Finding:
        bench.arm()
        time.sleep(_SETTLE_S)
        bench.watch.mark()
        before = int(bench.devices()["bus"][counter])
        began_ns = _servos(bench).inject(injected, times=1, **options)
        ends = time.monotonic() + 1.0
        while int(bench.devices()["bus"][counter]) == before and time.monotonic() < ends:
            time.sleep(0.002)
        seen_ns = time.monotonic_ns()
        time.sleep(LOOK_S)
        records = bench.watch.records()
        after = int(bench.devices()["bus"][counter])
        finding = Finding(tolerated=True, state=bench.now()[0].name)
        finding.detected = after > before and bool((safety(records) == Safety.ENABLED).all())
        # The counters are told ten times a second: the bus itself noticed it within its cycle.
        finding.detected_within_ms = max(0.0, (seen_ns - began_ns) * 1e-6)
        finding.counter = f"{counter} +{after - before}"
        finding.message = "counted under Devices; the next cycle makes up for it"
        _clear(bench)
        finding.recovered = bench.drives()
        return finding

    return measure


def _tolerated(name: str, title: str, injected: str, counter: str, **options: float) -> Fault:
    return Fault(
        name,
        Group.BUS,
        title,
        _counted(injected, counter, **options),
        Deadline.TOLD,
        mend=_clear,
        needs="hardware",
    )


def _other_name(bench: Bench, fault: Fault) -> Finding:
    """It is found by itself under its new name, and waits for a person."""
    finding = stopped(bench, fault)
    finding.remark = f"found again at {bench.bus_text('port')}"
    return finding


def _begin_other_name(bench: Bench) -> int:
    return _servos(bench).inject("another-name", delay_ms=300)


def _wait_found(bench: Bench) -> None:
    bench.wait(
        lambda: int(bench.watch.newest()["input"]["readiness"][0]) != Readiness.NOT_CONNECTED,
        "the bus is found again",
    )


def _encoder(bench: Bench, fault: Fault) -> Finding:
    """A position that stands while its goal moves: noticed once the deviation passes its limit."""
    bench.arm()
    bench.watch.mark()
    began_ns = fault.begin(bench)
    _bend(bench)
    place = bench.watch.until(lambda records: safety(records) != Safety.ENABLED, NOTICE_S)
    finding = Finding()
    if place is None:
        fault.mend(bench)
        finding.message = "nothing noticed it"
        return finding
    records = bench.watch.records()[: place + 1]
    passed = np.flatnonzero(_apart(bench, records))
    first_ns = stamp(records[-1:])
    onset_ns = stamp(records[passed[0] : passed[0] + 1]) if len(passed) else first_ns
    describe(bench, finding, place, onset_ns)
    finding.remark = (
        f"counted from the deviation passing its limit, {(first_ns - began_ns) * 1e-6:.0f} ms "
        "after the encoder stuck"
    )
    afterwards(bench, fault, finding)
    return finding


def _bend(bench: Bench) -> None:
    """Lead the tip where the segment has to bend much, by a target in place of the stylus."""
    bench.press(False)
    time.sleep(0.1)
    bench.api.call("POST", "/target", bench.turned_home())


def _apart(bench: Bench, records: Records) -> NDArray[np.bool_]:
    told = np.roll(records["outcome"]["command"]["servo"], 1, axis=0)
    told[0] = records["outcome"]["command"]["servo"][0]
    apart = np.abs(told - records["input"]["measured_servo"]).max(axis=1)
    limit_deg = bench.configuration.limits.servo_tracking_error_deg
    return np.asarray(apart > np.radians(limit_deg))


def _wrong_sign(bench: Bench, fault: Fault) -> Finding:
    """Homing finds a servo that turns the wrong way, and nothing is enabled after it."""
    bench.arm()
    bench.press(False)
    bench.ask("disable")
    fault.begin(bench)
    bench.watch.mark()
    asked = bench.ask("home")
    finding = Finding()
    if not asked.ok:
        finding.message = f"homing was refused: {asked.body.get('detail', '')}"
        fault.mend(bench)
        return finding
    began_ns = time.monotonic_ns()
    bench.watch.until(lambda r: r["input"]["readiness"] == Readiness.BUSY, NOTICE_S)
    bench.wait(
        lambda: int(bench.watch.newest()["input"]["readiness"][0]) != Readiness.BUSY,
        "the end of homing",
        60.0,
    )
    enabled = bench.ask("enable")
    took_ms = (time.monotonic_ns() - began_ns) * 1e-6
    finding.detected = not enabled.ok
    finding.detected_within_ms = 0.0 if finding.detected else None
    finding.state = bench.now()[0].name
    # The devices' report comes ten times a second.
    time.sleep(_SETTLE_S)
    finding.message = bench.bus_text("message")
    finding.remark = f"found while homing, {took_ms * 1e-3:.1f} s after its beginning"
    records = bench.watch.records()
    finding.commanded_travel_mm = commanded_path_mm(records)
    afterwards(bench, fault, finding)
    return finding


def _host_gone(number: signal.Signals) -> Callable[[Bench, Fault], Finding]:
    """Without a host the servos stop by their own watchdog; where they stand is seen on them."""

    def measure(bench: Bench, _fault: Fault) -> Finding:
        bench.arm()
        time.sleep(_SETTLE_S)
        old = bench.pid("control")
        bench.watch.mark()
        began_ns = bench.signal("control", number)
        time.sleep(_WATCHDOG_LOOK_S)
        tripped_ns = max(int(one["tripped_ns"]) for one in _servos(bench).state()["servos"])
        finding = Finding(detected=tripped_ns > began_ns, state="control down")
        finding.detected_within_ms = (tripped_ns - began_ns) * 1e-6
        records = bench.watch.records()
        late = records[records["header"]["stamp_ns"] > began_ns]
        finding.commanded_travel_mm = commanded_path_mm(late)
        finding.coast_mm = _bent_mm(bench, tripped_ns)
        finding.remark = "until all servos had stopped by themselves; the coast is their segment's"
        with contextlib.suppress(OSError):
            os.kill(old, signal.SIGKILL)
        bench.wait(lambda: bench.pid("control") not in (0, old), "control is back", 40.0)
        finding.message = bench.supervision()[0]["message"].decode(errors="replace")
        bench.watch.mark()
        bench.console.wait_until_running()
        time.sleep(LOOK_S)
        records = bench.watch.records()
        finding.stayed_stopped = stands_still(records) and commanded_path_mm(records) < 1e-3
        recovered(bench, finding)
        return finding

    return measure


def _bent_mm(bench: Bench, since_ns: int) -> float:
    """How far the simulated segment's end still came after a time, mm.

    Of the servos' own angles nothing can be said: their tendons relax a little as they stop.
    """
    moved = _servos(bench).positions(since_ns=since_ns)
    if not moved:
        return 0.0
    bends = np.array([one[2] for one in moved], dtype=float)
    length_mm = bench.configuration.instrument.segment_length_m * 1e3
    return float(np.linalg.norm(bends - bends[0], axis=1).max() * length_mm)


BUS_FAULTS = (
    _stopping("unplugged-while-reading", "The port hangs up while an answer is read",
              _inject("unplug-reading"), _LOST, Safety.PAUSED, _replug),
    _stopping("unplugged-while-writing", "The port hangs up while the host writes",
              _inject("unplug-writing"), _LOST, Safety.PAUSED, _replug),
    Fault("back-under-another-name", Group.BUS, "Unplugged, and back under another name",
          _other_name, Deadline.BUS, begin=_begin_other_name, mend=_wait_found, events=_LOST,
          state=Safety.PAUSED, needs="hardware"),
    _tolerated("crc-flip", "One bit of one answer is wrong", "crc-flip", "bad_packets"),
    _stopping("crc-flips", "Bits of many answers are wrong", _inject("crc-flip", times=_BURST),
              _LOST, Safety.FAULT),
    _tolerated("truncated-packet", "One answer ends in the middle", "truncated", "missed"),
    _stopping("truncated-packets", "Many answers end in the middle",
              _inject("truncated", times=_BURST), _LOST, Safety.FAULT),
    _tolerated("wrong-id", "One answer bears the id of nobody", "wrong-id", "missed"),
    _stopping("wrong-ids", "Many answers bear the id of nobody",
              _inject("wrong-id", times=_BURST), _LOST, Safety.FAULT),
    _tolerated("duplicate-reply", "An answer comes twice", "duplicate", "bad_packets"),
    _tolerated("late-reply", "An answer comes 20 ms late", "late", "missed", delay_ms=20),
    _stopping("time-outs", "A burst of answers does not come", _inject("timeouts", times=_BURST),
              _LOST, Safety.FAULT),
    _stopping("servo-overload", "A servo is overloaded", _inject("overload", servo=_SERVO),
              (Event.SERVO_FAULT,), Safety.FAULT),
    _stopping("servo-overheat", "A servo is too hot", _inject("overheat", servo=_SERVO),
              (Event.SERVO_FAULT,), Safety.FAULT),
    _stopping("servo-voltage", "A servo gets 5 V", _inject("voltage", servo=_SERVO),
              (Event.SERVO_FAULT,), Safety.FAULT),
    _stopping("servo-silent", "One servo says nothing", _inject("silent", servo=_SERVO),
              (Event.SERVO_SILENT,), Safety.FAULT),
    Fault("encoder-stuck", Group.BUS, "A servo's encoder is stuck", _encoder, Deadline.BUS,
          begin=_inject("encoder-stuck", servo=101), mend=_clear, state=Safety.FAULT,
          needs="hardware"),
    Fault("wrong-sign", Group.BUS, "A servo is mounted the other way round", _wrong_sign,
          Deadline.BUS, begin=_inject("reversed", servo=_SERVO), mend=_clear, state=Safety.DISABLED,
          needs="hardware"),
    Fault("host-killed", Group.BUS, "SIGKILL of the control process under way",
          _host_gone(signal.SIGKILL), Deadline.WATCHDOG, state=Safety.DISABLED, needs="hardware"),
    Fault("host-hung", Group.BUS, "The control process hangs under way",
          _host_gone(signal.SIGSTOP), Deadline.WATCHDOG, state=Safety.DISABLED, needs="hardware"),
)  # fmt: skip
