"""Poses in which the mathematics gets difficult: reached by paths, and left again."""

from __future__ import annotations

import time

import numpy as np

from robot.records import Safety
from server.faults.bench import Bench
from server.faults.demands import BenchFailed, Deadline
from server.faults.fault import Fault, Finding, Group
from server.faults.stopping import NOTICE_S
from server.faults.watching import Records, safety

_PATH_S = 40.0
_RCM_MM = 0.1


def _play(bench: Bench, start: str, body: dict[str, object] | None) -> Records:
    """Play a path to its end; the records of it."""
    bench.press(False)
    bench.recover()
    time.sleep(0.1)
    bench.watch.mark()
    asked = bench.api.call("POST", start, body)
    if not asked.ok:
        raise BenchFailed(f"the path was refused: {asked.body.get('detail', '')}")
    bench.watch.until(lambda records: records["header"]["path_id"] != 0, NOTICE_S)
    ends = time.monotonic() + _PATH_S
    while time.monotonic() < ends and bench.watch.newest()["header"]["path_id"][0]:
        bench.api.take_lease()
        time.sleep(0.05)
    return bench.watch.records()


def _sound(bench: Bench, finding: Finding, records: Records) -> bool:
    """Whether every tick kept numbers, limits and trocar, and nothing stopped."""
    outcome = records["outcome"]
    numbers = bool(np.isfinite(outcome["report"]["x"]).all())
    speed = bench.configuration.limits.joint_speed_rad_s
    within = bool((np.abs(outcome["report"]["x_dot"][:, :7]) <= speed * 1.001).all())
    beside_mm = float(outcome["report"]["residual_rcm"].max() * 1e3)
    finding.state = bench.now()[0].name
    finding.remark = (
        f"{len(records)} ticks, largest speed at the trocar {beside_mm:.4f} mm/s, "
        f"largest joint speed {np.abs(outcome['report']['x_dot'][:, :7]).max():.2f} rad/s"
    )
    return numbers and within and bool((safety(records) == Safety.ENABLED).all())


def _held_back(finding: Finding, records: Records) -> bool:
    """Whether the report says at once that limits hold the tip back."""
    report = records["outcome"]["report"]
    active = report["limits_active"] != 0
    given_up = (report["residual_linear"] > 1e-4) | (report["residual_angular"] > 1e-3)
    unsaid = int((given_up & ~active).sum())
    finding.counter = (
        f"limits_active in {int(active.sum())} ticks; given up without saying so: {unsaid}"
    )
    finding.detected_within_ms = 0.0
    return bool(active.any()) and unsaid <= len(records) // 100


def _singular(bench: Bench, _fault: Fault) -> Finding:
    """Straight is where the direction of bending is not defined: it is passed like any other."""
    bench.api.call("PUT", "/priority", {"solver": "closed-form", "coordinates": "polar"})
    finding = Finding(tolerated=True, detected_within_ms=0.0)
    try:
        records = _play(bench, "/withdraw", None)
        theta = records["outcome"]["report"]["theta"]
        straight = float(np.degrees(np.abs(theta - 0.5 * np.pi)).min())
        finding.detected = _sound(bench, finding, records) and straight < 1.0
        finding.counter = f"within {straight:.3f} deg of straight, in polar coordinates"
        finding.message = "nothing is to be noticed: there is no singular pose for (u, v)"
    finally:
        bench.api.call("PUT", "/priority", {"solver": "hqp", "coordinates": "uv"})
    finding.recovered = bench.now()[0] == Safety.ENABLED
    return finding


def _at_trocar(bench: Bench, _fault: Fault) -> Finding:
    """The tip at the trocar: it can hardly move aside, and the trocar comes first."""
    records = _play(bench, "/withdraw", None)
    lam = records["outcome"]["report"]["x"][:, 9]
    bench.watch.mark()
    finding = Finding(tolerated=True)
    driven = bench.drives()
    time.sleep(1.0)
    records = bench.watch.records()
    finding.detected = _sound(bench, finding, records)
    finding.detected_within_ms = 0.0
    finding.counter = f"lambda up to {lam.max():.3f}, limits_active {_ticks_limited(records)} ticks"
    finding.message = str(bench.api.state().get("safety", {}).get("reason", ""))
    finding.recovered = driven
    return finding


def _ticks_limited(records: Records) -> int:
    return int((records["outcome"]["report"]["limits_active"] != 0).sum())


def _infeasible(bench: Bench, _fault: Fault) -> Finding:
    """A path that asks for more bend than there is: what is given up is told in the same tick."""
    finding = Finding(tolerated=True)
    records = _play(bench, "/path", {"experiment": "circle-infeasible"})
    sound = _sound(bench, finding, records)
    finding.detected = _held_back(finding, records) and sound
    finding.message = "the limit is named; the path goes on as near as it can"
    finding.recovered = bench.drives()
    return finding


POSE_FAULTS = (
    Fault("infeasible-problem", Group.CONTROL, "A path asks for more than the limits allow",
          _infeasible, Deadline.BUS),
    Fault("singular-pose", Group.CONTROL, "The segment is straight, in polar coordinates",
          _singular, Deadline.BUS),
    Fault("tip-at-the-trocar", Group.CONTROL, "The tip is drawn back to the trocar", _at_trocar,
          Deadline.BUS),
)  # fmt: skip
