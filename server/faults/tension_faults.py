"""Faults of the tension-feedback unit and of what is felt with it, on the simulated robot."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import Safety
from robot.safety import Event
from robot.sensing.faults import REASONS, SensingFault
from robot.tension.records import TendonMode
from server.faults.bench import Bench
from server.faults.demands import Deadline
from server.faults.fault import Fault, Finding, Group
from server.faults.stopping import LOOK_S, NOTICE_S, deviates, stamp, stopped
from server.faults.watching import safety

_SETTLE_S = 0.5


def with_tension_unit(base: Configuration) -> Configuration:
    """The same console, its simulated robot driven by the tension-feedback unit."""
    driven = {"actuation": "tension-unit", "plant": "physics"}
    return base.model_copy(update={"simulation": base.simulation.model_copy(update=driven)})


def _while_held(bench: Bench, name: str) -> int:
    """Inject it into a robot whose loose tendons hold their tension."""
    bench.hold_tendons("hybrid")
    time.sleep(_SETTLE_S)
    bench.watch.mark()
    return bench.inject(name)


def _mend(bench: Bench) -> None:
    bench.mend()
    bench.hold_tendons("position")


def _held(name: str, title: str, deadline: Deadline = Deadline.BUS) -> Fault:
    return Fault(
        name,
        Group.CONTROL,
        f"{title}, and tensions are held",
        stopped,
        deadline,
        begin=lambda bench: _while_held(bench, name),
        mend=_mend,
        events=(Event.TENSION_UNKNOWN,),
        state=Safety.PAUSED,
        needs="tension-unit",
    )


def _run_away(bench: Bench) -> NDArray[np.bool_]:
    """For every record: whether a tendon that holds its tension is too far from its length."""
    records, configuration = bench.watch.records(), bench.configuration
    before = np.roll(records["outcome"]["state"], 1)
    before[0] = records["outcome"]["state"][0]
    off = np.abs(records["input"]["measured_servo"] - before["tendon_servo"])
    off *= configuration.module.pulley_radius_m * 1e3
    held = before["tendon_mode"] == TendonMode.TENSION
    return np.asarray((held & (off > configuration.tendons.travel_mm)).any(axis=1))


def _breaks(bench: Bench, fault: Fault) -> Finding:
    finding = deviates(bench, fault, lambda: fault.begin(bench), _run_away)
    if finding.recovered:
        # Its pulley comes back while the robot is driven, and then it can be tied again.
        _wait_until_felt(bench)
    return finding


def _wait_until_felt(bench: Bench) -> None:
    bench.wait(
        lambda: bench.watch.newest()["outcome"]["report"]["estimate_fault"][0] == SensingFault.NONE,
        "shape and force are felt",
    )


def _not_felt(bench: Bench, fault: Fault) -> Finding:
    """Lengths are held, and the robot is driven on: what is felt is marked as invalid, and why."""
    bench.arm()
    _wait_until_felt(bench)
    bench.watch.mark()
    began_ns = fault.begin(bench)
    place = bench.watch.until(
        lambda records: records["outcome"]["report"]["estimate_fault"] != SensingFault.NONE,
        NOTICE_S,
    )
    finding = Finding(tolerated=True)
    if place is None:
        finding.message = "nothing noticed it"
        fault.mend(bench)
        return finding
    time.sleep(LOOK_S)
    records = bench.watch.records()
    first = records[place : place + 1]
    said = SensingFault(int(first["outcome"]["report"]["estimate_fault"][0]))
    finding.detected_within_ms = max(0.0, (stamp(first) - began_ns) * 1e-6)
    finding.state = bench.now()[0].name
    finding.detected = bool((safety(records) == Safety.ENABLED).all())
    finding.message = "; ".join(REASONS[said])
    finding.counter = f"estimate_fault = {said.name}"
    fault.mend(bench)
    finding.recovered = bench.drives()
    _wait_until_felt(bench)
    return finding


def _unfelt(name: str, plant_fault: str, title: str, deadline: Deadline = Deadline.BUS) -> Fault:
    return Fault(
        name,
        Group.CONTROL,
        f"{title}, and lengths are held",
        _not_felt,
        deadline,
        begin=lambda bench: bench.inject(plant_fault),
        mend=Bench.mend,
        needs="tension-unit",
    )


TENSION_FAULTS = (
    _held("cell-missing", "A torque cell gives no reading"),
    _held("cell-saturated", "A torque cell is at its end"),
    _held("cell-flat", "A torque cell's reading stays as it is", Deadline.FLAT),
    Fault(
        "tendon-broken",
        Group.CONTROL,
        "A tendon breaks, and tensions are held",
        _breaks,
        Deadline.BUS,
        begin=lambda bench: _while_held(bench, "tendon-broken"),
        mend=_mend,
        events=(Event.TENDON_RUNS,),
        state=Safety.FAULT,
        needs="tension-unit",
    ),
    _unfelt("cell-missing-unheld", "cell-missing", "A torque cell gives no reading"),
    _unfelt("tendon-broken-unheld", "tendon-broken", "A tendon breaks"),
    _unfelt("tracker-lost", "tracker-lost", "The tracker does not see the tip", Deadline.ALIGNED),
)
