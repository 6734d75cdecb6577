"""Faults around the robot: processes, connections, people, clocks and disks."""

from __future__ import annotations

import contextlib
import os
import signal
import time

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from robot.records import Safety
from robot.safety import Event
from server.faults.access import Api
from server.faults.bench import Bench
from server.faults.demands import Deadline
from server.faults.fault import Fault, Finding, Group
from server.faults.stopping import LOOK_S, NOTICE_S, recovered, stopped
from server.faults.watching import commanded_path_mm, reach_mm, safety, stands_still

_GONE = (Event.OPERATOR_LOST, Event.LEADER_STALE)
_RESTART_S = 40.0


def _kill(name: str) -> Fault:
    return Fault(
        f"{name}-killed",
        Group.SYSTEM,
        f"SIGKILL of the {name} process",
        stopped,
        Deadline.HANG_UP,
        begin=lambda bench: bench.signal(name, signal.SIGKILL),
        mend=_web_is_back,
        events=_GONE,
        state=Safety.PAUSED,
    )


def _web_is_back(bench: Bench) -> None:
    bench.wait(lambda: bool(bench.api.state()), "the web process is back", _RESTART_S)


def _sleep(bench: Bench) -> int:
    began_ns = time.monotonic_ns()
    bench.page.quiet = True
    return began_ns


def _awake(bench: Bench) -> None:
    bench.page.quiet = False


def _freeze(bench: Bench) -> int:
    return bench.signal("web", signal.SIGSTOP)


def _thaw(bench: Bench) -> None:
    with contextlib.suppress(OSError):
        bench.signal("web", signal.SIGCONT)


def _control_gone(bench: Bench, fault: Fault, number: signal.Signals) -> Finding:
    """Without control nothing is commanded; another one comes, DISABLED, and stays so."""
    bench.arm()
    bench.watch.mark()
    old = bench.pid("control")
    began_ns = bench.signal("control", number)
    finding = Finding()
    bench.wait(lambda: bench.pid("control") != old, "the supervisor notices", NOTICE_S)
    told = bench.supervision()[0]
    finding.detected, finding.state = True, "control down"
    finding.detected_within_ms = max(0.0, (int(told["stamp_ns"]) - began_ns) * 1e-6)
    finding.message = told["message"].decode(errors="replace")
    time.sleep(0.1)
    records = bench.watch.records()
    late = records[records["header"]["stamp_ns"] > began_ns]
    finding.commanded_travel_mm, finding.coast_mm = commanded_path_mm(late), reach_mm(late)
    bench.wait(lambda: bench.pid("control") not in (0, old), "control is back", _RESTART_S)
    bench.watch.mark()
    bench.console.wait_until_running()
    time.sleep(LOOK_S)
    records = bench.watch.records()
    finding.stayed_stopped = stands_still(records) and commanded_path_mm(records) < 1e-3
    recovered(bench, finding)
    return finding


def _hung_control(bench: Bench, fault: Fault) -> Finding:
    return _control_gone(bench, fault, signal.SIGSTOP)


def _killed_control(bench: Bench, fault: Fault) -> Finding:
    return _control_gone(bench, fault, signal.SIGKILL)


def _ended_control(bench: Bench, fault: Fault) -> Finding:
    return _control_gone(bench, fault, signal.SIGTERM)


def _goes_on(bench: Bench, finding: Finding) -> bool:
    records = bench.watch.records()
    finding.state = bench.now()[0].name
    return bool((safety(records) == Safety.ENABLED).all())


def _second_operator(bench: Bench, _fault: Fault) -> Finding:
    """Whoever comes second is told who drives, and moves nothing."""
    bench.arm()
    bench.watch.mark()
    other = Api(bench.api.base, bench.console.token)
    asked_ns = time.monotonic_ns()
    answer = other.call("POST", "/lease", {"operator": "somebody else"})
    finding = Finding(tolerated=True)
    finding.detected_within_ms = (time.monotonic_ns() - asked_ns) * 1e-6
    pose = {"position_mm": [0, 0, 0], "orientation_wxyz": [1, 0, 0, 0], "clutch": True}
    acts = [
        other.call("POST", "/enable"),
        other.call("POST", "/leader", pose),
        other.call("PUT", "/priority", {"case": "0"}),
    ]
    finding.message = str(answer.body.get("detail", ""))
    refused = all(400 <= one.status < 500 for one in (answer, *acts))
    finding.detected = refused and _goes_on(bench, finding)
    finding.counter = f"refused with {answer.status}, and {len(acts)} acts without a lease"
    finding.recovered = bench.drives()
    return finding


def _slow_client(bench: Bench, _fault: Fault) -> Finding:
    """A client that stops reading is waited for, and nobody else waits for it."""
    bench.arm()
    bench.watch.mark()
    began = time.monotonic()
    lateness_before = bench.watch.newest()["header"]["overruns"][0]
    with connect(
        bench.api.stream_address + "?rate_hz=120",
        additional_headers={"Authorization": bench.api.headers["Authorization"]},
        compression=None,
        proxy=None,
        max_queue=1,
        close_timeout=0.2,
        ping_interval=None,
    ) as slow:
        slow.socket.setsockopt(1, 8, 4096)
        time.sleep(2.0)
        ages = [bench.api.state().get("age_ms", 1e9) for _ in range(5)]
        finding = Finding(tolerated=True, detected_within_ms=0.0)
        read, ends = 0, time.monotonic() + 0.25
        with contextlib.suppress(TimeoutError, WebSocketException):
            while time.monotonic() < ends:
                slow.recv(timeout=0.05)
                read += 1
    passed = time.monotonic() - began
    overruns = int(bench.watch.newest()["header"]["overruns"][0] - lateness_before)
    finding.detected = _goes_on(bench, finding) and max(ages) < 100.0 and read < 60 * passed
    finding.message = "it gets the newest state, never a backlog"
    finding.counter = f"{read} states sent of {120 * passed:.0f}; others: {max(ages):.0f} ms old"
    finding.remark = f"{overruns} overruns meanwhile"
    finding.recovered = bench.drives()
    return finding


def _sigterm(bench: Bench, _fault: Fault) -> Finding:
    """The console holds and ends in order; nothing of it is left."""
    bench.arm()
    bench.watch.mark()
    pids = [bench.pid("control"), bench.pid("web")]
    began_ns = time.monotonic_ns()
    bench.console.process.terminate()
    status = bench.console.process.wait(20.0)
    records = bench.watch.records()
    late = records[records["header"]["stamp_ns"] > began_ns]
    finding = Finding(state="ended")
    finding.detected_within_ms = 0.0
    if len(late):
        finding.detected_within_ms = (int(late["header"]["stamp_ns"][-1]) - began_ns) * 1e-6
    finding.remark = (
        f"exit status {status}; control's last tick {finding.detected_within_ms:.0f} ms after it, "
        f"during which the tip still followed its leader by {commanded_path_mm(late):.2f} mm"
    )
    finding.commanded_travel_mm, finding.coast_mm = 0.0, reach_mm(late[-1:])
    finding.detected = status == 0 and not any(_lives(pid) for pid in pids)
    finding.message = "the console ends; the robot holds"
    return finding


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


SYSTEM_FAULTS = (
    Fault(
        "socket-dropped",
        Group.SYSTEM,
        "The operator's connection is cut",
        stopped,
        Deadline.LEADER,
        begin=lambda bench: bench.page.cut(),
        events=_GONE,
        state=Safety.PAUSED,
    ),
    Fault(
        "tab-asleep",
        Group.SYSTEM,
        "The page falls asleep: neither samples nor heartbeats",
        stopped,
        Deadline.LEADER,
        begin=_sleep,
        mend=_awake,
        events=_GONE,
        state=Safety.PAUSED,
    ),
    Fault("slow-client", Group.SYSTEM, "A client does not read", _slow_client, Deadline.LEADER),
    Fault(
        "second-operator",
        Group.SYSTEM,
        "A second operator wants to drive",
        _second_operator,
        Deadline.ANSWER,
    ),
    _kill("web"),
    Fault(
        "web-hung",
        Group.SYSTEM,
        "The web process hangs",
        stopped,
        Deadline.LEADER,
        begin=_freeze,
        mend=_thaw,
        events=_GONE,
        state=Safety.PAUSED,
    ),
    Fault(
        "control-killed",
        Group.SYSTEM,
        "SIGKILL of the control process",
        _killed_control,
        Deadline.HANG_UP,
        state=Safety.DISABLED,
    ),
    Fault(
        "control-hung",
        Group.SYSTEM,
        "The control process hangs",
        _hung_control,
        Deadline.HUNG,
        state=Safety.DISABLED,
    ),
    Fault(
        "control-ended",
        Group.SYSTEM,
        "SIGTERM of the control process",
        _ended_control,
        Deadline.HANG_UP,
        state=Safety.DISABLED,
    ),
)
LAST_FAULTS = (
    Fault(
        "sigterm",
        Group.SYSTEM,
        "SIGTERM of the console",
        _sigterm,
        Deadline.HANG_UP,
        state=Safety.DISABLED,
    ),
)
"""After these there is no console any more."""
