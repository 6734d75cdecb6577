"""Faults of the robot and of the control process, injected into the simulated robot."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from robot.records import Refusal, Safety
from robot.safety import Event
from server.faults.bench import Bench
from server.faults.demands import Deadline
from server.faults.fault import Fault, Finding, Group
from server.faults.stopping import (
    LOOK_S,
    NOTICE_S,
    afterwards,
    describe,
    deviates,
    recovered,
    stamp,
    stopped,
)
from server.faults.watching import (
    Records,
    commanded_path_mm,
    reach_mm,
    safety,
    stands_still,
)

_RESTART_S = 40.0
_AXIS = (Event.TRACKING_ERROR, Event.TROCAR_LEFT, Event.CLEARANCE)


def _in_plant(
    name: str,
    title: str,
    event: Event,
    state: Safety,
    also: tuple[Event, ...] = (),
    deadline: Deadline = Deadline.BUS,
) -> Fault:
    return Fault(
        name,
        Group.CONTROL,
        title,
        stopped,
        deadline,
        begin=lambda bench: bench.inject(name),
        mend=Bench.mend,
        events=(event, *also),
        state=state,
    )


def _exceeds(bench: Bench) -> NDArray[np.bool_]:
    """For every record: whether commanded and measured, or shaft and trocar, are too far apart."""
    records, limits = bench.watch.records(), bench.configuration.limits
    state, given = records["outcome"]["state"], records["input"]
    before = np.roll(state["x"][:, :7], 1, axis=0)
    before[0] = state["x"][0, :7]
    joints = np.abs(before - given["measured_q"]).max(axis=1) > limits.tracking_error_rad
    told = np.roll(records["outcome"]["command"]["servo"], 1, axis=0)
    told[0] = records["outcome"]["command"]["servo"][0]
    apart = np.abs(told - given["measured_servo"]).max(axis=1)
    servos = apart > np.radians(limits.servo_tracking_error_deg)
    beside = state["trocar_distance"] * 1e3 > limits.trocar_distance_mm
    return np.asarray(joints | servos | beside)


def _stuck(bench: Bench, fault: Fault) -> Finding:
    """An axis that stands while it is told to: noticed as soon as the deviation passes its limit.

    The leader turns the tip as well, or a stuck axis may never be asked to go far enough.
    """

    def begin() -> int:
        began_ns = fault.begin(bench)
        bench.page.circle.swing(True)
        return began_ns

    try:
        return deviates(bench, fault, begin, _exceeds)
    finally:
        bench.page.circle.swing(False)


def _exception(bench: Bench, fault: Fault) -> Finding:
    """The loop ends with a last record in FAULT; the supervisor starts it again, DISABLED."""
    bench.arm()
    bench.watch.mark()
    before = bench.pid("control")
    began_ns = time.monotonic_ns()
    bench.api.call("POST", "/faults", {"name": fault.name}, timeout_s=0.5)
    place = bench.watch.until(lambda records: safety(records) == Safety.FAULT, NOTICE_S)
    finding = Finding()
    if place is None:
        finding.message = "nothing noticed it"
        return finding
    records = bench.watch.records()[: place + 1]
    began_ns = max(began_ns, stamp(records[-2:-1]) if place else began_ns)
    describe(bench, finding, place, began_ns)
    bench.wait(lambda: bench.pid("control") not in (0, before), "control is back", _RESTART_S)
    bench.watch.mark()
    bench.console.wait_until_running()
    time.sleep(LOOK_S)
    records = bench.watch.records()
    finding.stayed_stopped = stands_still(records) and commanded_path_mm(records) < 1e-3
    recovered(bench, finding)
    return finding


def _outside_at_start(bench: Bench, fault: Fault) -> Finding:
    """A robot that stands outside its limits cannot be enabled."""
    bench.arm()
    bench.press(False)
    bench.ask("disable")
    bench.watch.mark()
    began_ns = bench.inject("outside-limits")
    place = bench.watch.until(lambda records: records["input"]["readiness"] != 0, NOTICE_S)
    asked = bench.ask("enable")
    finding = Finding(detected=place is not None and not asked.ok)
    finding.state = bench.now()[0].name
    finding.message = str(asked.body.get("detail", "it was enabled"))
    if place is not None:
        first_ns = stamp(bench.watch.records()[place : place + 1])
        finding.detected_within_ms = max(0.0, (first_ns - began_ns) * 1e-6)
    bench.press(True)
    time.sleep(LOOK_S)
    records = bench.watch.records()
    finding.commanded_travel_mm, finding.coast_mm = commanded_path_mm(records), reach_mm(records)
    afterwards(bench, fault, finding)
    return finding


def _goes_on(records: Records) -> bool:
    return bool((safety(records) == Safety.ENABLED).all())


def _picture(bench: Bench, fault: Fault) -> Finding:
    """What cannot be drawn must not stop what drives: neither control nor the server."""
    bench.arm()
    restarts = bench.api.state().get("control"), bench.pid("web"), bench.pid("control")
    bench.watch.mark()
    began_ns = fault.begin(bench)
    time.sleep(LOOK_S)
    state = bench.api.state()
    records = bench.watch.records()
    shows = ~np.isfinite(records["truth"]["position"]).all(axis=1)
    place = int(np.flatnonzero(shows)[0]) if shows.any() else None
    finding = Finding(tolerated=True)
    answered = bool(state) and state.get("true", {}).get("position_mm") in (None, [None] * 3)
    finding.detected = place is not None and answered and _goes_on(records)
    if place is not None:
        first_ns = stamp(records[place : place + 1])
        finding.detected_within_ms = max(0.0, (first_ns - began_ns) * 1e-6)
    finding.state = bench.now()[0].name
    finding.message = "the true pose is shown as unknown"
    finding.counter = "the state message's true pose is null"
    same = restarts == (bench.api.state().get("control"), bench.pid("web"), bench.pid("control"))
    finding.remark = "no process was restarted" if same else "a process was restarted"
    finding.detected &= same
    fault.mend(bench)
    finding.recovered = bench.drives()
    return finding


def _pulled(bench: Bench, refusal: Refusal, direction: NDArray[np.float64]) -> Finding:
    """The leader pulls where the tip must not go: it stays at the border, and says why."""
    bench.arm()
    bench.watch.mark()
    began_ns = time.monotonic_ns()
    bench.page.circle.pull(direction)
    place = bench.watch.until(
        lambda records: records["outcome"]["report"]["target_refused"] == refusal, NOTICE_S
    )
    finding = Finding(tolerated=True, state=bench.now()[0].name)
    finding.counter = f"target_refused = {refusal.name}"
    if place is not None:
        time.sleep(LOOK_S)
        records = bench.watch.records()
        finding.detected = _goes_on(records)
        beyond = _beyond(bench, records)
        held = np.flatnonzero(beyond > 0.0)
        first = records[place : place + 1]
        onset_ns = stamp(records[held[0] : held[0] + 1]) if len(held) else stamp(first)
        finding.detected_within_ms = max(0.0, (stamp(first) - min(onset_ns, stamp(first))) * 1e-6)
        finding.remark = (
            f"the target was refused {(stamp(first) - began_ns) * 1e-6:.0f} ms after the pull "
            f"began; the tip never came beyond the border by more than {beyond.max():.3f} mm"
        )
        finding.detected &= bool(beyond.max() < 0.1)
        finding.message = str(bench.api.state().get("safety", {}).get("reason", ""))
    bench.page.circle.pull(None)
    finding.recovered = bench.drives()
    return finding


def _beyond(bench: Bench, records: Records) -> NDArray[np.float64]:
    """How far the commanded tip is above the body wall, mm."""
    normal = np.array(bench.configuration.trocar.wall_normal)
    tip = records["outcome"]["report"]["commanded_position"]
    return np.asarray((tip - records["input"]["trocar_position"]) @ normal * 1e3)


CONTROL_FAULTS = (
    _in_plant(
        "measurement-lost", "Measurements are invalid", Event.MEASUREMENT_LOST, Safety.FAULT
    ),
    Fault(
        "measurement-silent",
        Group.CONTROL,
        "Measurements stop coming",
        stopped,
        Deadline.LEADER,
        begin=lambda bench: bench.inject("measurement-silent"),
        mend=Bench.mend,
        events=(Event.MEASUREMENT_LOST,),
        state=Safety.FAULT,
    ),
    _in_plant(
        "measurement-nan", "A measurement is no number", Event.MEASUREMENT_LOST, Safety.FAULT
    ),
    Fault(
        "joint-stuck",
        Group.CONTROL,
        "A joint of the arm is stuck",
        _stuck,
        Deadline.BUS,
        begin=lambda bench: bench.inject("joint-stuck"),
        mend=Bench.mend,
        events=_AXIS,
        state=Safety.FAULT,
    ),
    Fault(
        "servo-stuck",
        Group.CONTROL,
        "A servo is stuck",
        _stuck,
        Deadline.BUS,
        begin=lambda bench: bench.inject("servo-stuck"),
        mend=Bench.mend,
        events=_AXIS,
        state=Safety.FAULT,
    ),
    _in_plant("encoder-jump", "An encoder jumps", Event.TRACKING_ERROR, Safety.FAULT,
              also=(Event.TROCAR_LEFT, Event.CLEARANCE)),
    _in_plant("arm-pushed", "Something pushes the arm off the trocar", Event.TROCAR_LEFT,
              Safety.FAULT, also=(Event.TRACKING_ERROR,), deadline=Deadline.LEADER),
    _in_plant("contact", "The instrument presses too hard", Event.CONTACT_FORCE, Safety.PAUSED,
              ),
    Fault(
        "outside-limits-at-start",
        Group.CONTROL,
        "The robot stands outside its limits at the start",
        _outside_at_start,
        Deadline.BUS,
        mend=Bench.mend,
        state=Safety.DISABLED,
    ),
    _in_plant("late-tick", "A tick is overrun by 150 ms", Event.CONTROL_LATE, Safety.PAUSED,
              also=(Event.LEADER_STALE,), deadline=Deadline.LATE),
    Fault(
        "plant-exception",
        Group.CONTROL,
        "The plant's code fails",
        _exception,
        Deadline.BUS,
        state=Safety.FAULT,
    ),
    Fault(
        "exception-in-a-plot",
        Group.CONTROL,
        "What is to be drawn is no number",
        _picture,
        Deadline.BUS,
        begin=lambda bench: bench.inject("picture-impossible"),
        mend=Bench.mend,
    ),
    Fault(
        "target-behind-the-trocar",
        Group.CONTROL,
        "The leader pulls the tip out through the trocar",
        lambda bench, fault: _pulled(bench, Refusal.BEHIND_TROCAR, np.array([0.0, 0.0, 300.0])),
        Deadline.BUS,
    ),
)  # fmt: skip
