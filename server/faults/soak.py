"""Drives for long while one thing after the other breaks, and looks what is left of it all."""

from __future__ import annotations

import random
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.records import Safety
from robot.safety import TRANSITIONS, Event
from server.faults.bench import Bench
from server.faults.bus_faults import BUS_FAULTS
from server.faults.fault import Fault
from server.faults.stylus_faults import STYLUS_FAULTS
from server.faults.system_faults import SYSTEM_FAULTS
from server.faults.table import bench_configuration, measured
from server.faults.watching import Watch, reason, safety

SCHEMA_VERSION = 1
LARGEST_GROWTH_MB = 24.0
"""What a process may grow by while it lives, once it has settled."""

_TOO_LONG = ("wrong-sign", "encoder-stuck", "host-hung", "control-hung")
_SYSTEM = ("socket-dropped", "web-killed", "second-operator", "slow-client")
_LOOK_S, _MEMORY_S = 0.25, 2.0
_SETTLED_SHARE = 0.3
_SCALE = 0.8
_ALLOWED = {(row.state, row.event, row.next) for row in TRANSITIONS}
_ROLES = {
    "server.control.process": "control",
    "server.web.process": "web",
    "server.recording.recorder_process": "recorder",
    "server.leaders.process": "leader",
    "server.command_line console": "supervisor",
}


def soak_faults() -> tuple[Fault, ...]:
    """What is drawn from."""
    bus = [one for one in (*BUS_FAULTS, *STYLUS_FAULTS) if one.name not in _TOO_LONG]
    return (*bus, *(one for one in SYSTEM_FAULTS if one.name in _SYSTEM))


@dataclass
class Memory:
    """Resident memory of the console's processes over time, MB by role and process id."""

    samples: dict[tuple[str, int], list[tuple[float, float]]] = field(default_factory=dict)

    def look(self, supervisor: int) -> None:
        """Take one sample of the supervisor and its children."""
        listed = subprocess.run(
            ["ps", "-A", "-ww", "-o", "pid=,ppid=,rss=,args="],
            capture_output=True,
            text=True,
            check=False,
        ).stdout
        for line in listed.splitlines():
            pid, parent, kilobytes, words = line.split(None, 3)
            if supervisor not in (int(pid), int(parent)):
                continue
            role = next((name for module, name in _ROLES.items() if module in words), "other")
            seen = self.samples.setdefault((role, int(pid)), [])
            seen.append((time.monotonic(), int(kilobytes) / 1024.0))

    def summary(self) -> list[dict[str, Any]]:
        """For each process: first and last MB, growth and slope once it had settled."""
        found = []
        for (role, pid), seen in self.samples.items():
            settled = seen[round(len(seen) * _SETTLED_SHARE) :]
            times = np.array([at for at, _ in settled])
            sizes = np.array([size for _, size in settled])
            slope = 0.0
            if len(settled) > 2 and np.ptp(times) > 0.0:
                slope = float(np.polyfit(times - times[0], sizes, 1)[0]) * 60.0
            found.append(
                {
                    "process": role,
                    "pid": pid,
                    "lived_s": round(seen[-1][0] - seen[0][0], 1),
                    "first_mb": round(seen[0][1], 1),
                    "last_mb": round(seen[-1][1], 1),
                    "growth_mb": round(float(sizes[-1] - sizes[0]), 2),
                    "slope_mb_min": round(slope, 3),
                }
            )
        return found


class Reader:
    """Reads every record from a thread of its own and checks what must hold of each.

    Attributes:
        records: how many there were. transitions: changes of the safety state among them.
        faults: what did not hold, in words.
    """

    def __init__(self, directory: Path, supervisor: int) -> None:
        self.memory = Memory()
        self.records = self.transitions = 0
        self.faults: list[str] = []
        self._watch, self._supervisor = Watch(directory), supervisor
        self._before: tuple[int, int] | None = None
        self._tick = 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Read the rest and end."""
        self._over.set()
        self._thread.join(10.0)
        self._watch.close()

    def _run(self) -> None:
        due = 0.0
        while not self._over.wait(_LOOK_S):
            self._take()
            if time.monotonic() > due:
                due = time.monotonic() + _MEMORY_S
                self.memory.look(self._supervisor)
        self._take()

    def _take(self) -> None:
        found = self._watch.take()
        if self._watch.lost:
            self._watch.lost = False
            self.faults.append("records were lost between writer and reader")
        self.records += len(found)
        states, reasons = safety(found), reason(found)
        ticks = found["header"]["tick"]
        for place in range(len(found)):
            state, why, tick = int(states[place]), int(reasons[place]), int(ticks[place])
            anew = tick <= 1 or tick < self._tick
            if not anew and self._tick and tick != self._tick + 1:
                self.faults.append(f"tick {tick} follows {self._tick}")
            if anew and state != Safety.DISABLED:
                self.faults.append(f"control began anew in {Safety(state).name}")
            if not anew and self._before is not None and self._before != (state, why):
                self._explain(self._before[0], why, state)
            self._before, self._tick = (state, why), tick

    def _explain(self, before: int, why: int, state: int) -> None:
        self.transitions += 1
        one = (Safety(before), Event(why), Safety(state))
        two_in_one_tick = any(
            (Safety(before), first.event, first.next) in _ALLOWED
            and (first.next, Event(why), Safety(state)) in _ALLOWED
            for first in TRANSITIONS
        )
        if one not in _ALLOWED and not two_in_one_tick:
            names = f"{one[0].name} to {one[2].name} by {one[1].name}"
            self.faults.append(f"not in the transition table: {names}")


def run(
    seconds: float,
    seed: int,
    configuration: Configuration,
    progress: Callable[[float, str], None] = lambda share, name: None,
) -> dict[str, Any]:
    """Break and mend for ``seconds``; the document of ``keyhole soak --json``."""
    draw = random.Random(seed)
    known = soak_faults()
    base = bench_configuration(configuration)
    happened: list[dict[str, Any]] = []
    with (
        tempfile.TemporaryDirectory(prefix="keyhole-soak-") as folder,
        Bench(Path(folder) / "hardware", base, hardware=True) as bench,
    ):
        bench.arm()
        bench.api.call("PUT", "/teleoperation", {"motion_scale": _SCALE})
        reader = Reader(bench.console.directory, bench.console.process.pid)
        started = time.monotonic()
        while time.monotonic() - started < seconds:
            fault = draw.choice(known)
            progress((time.monotonic() - started) / seconds, fault.name)
            happened.append(measured(bench, fault))
            time.sleep(draw.uniform(0.0, 0.5))
        drives = _drives(bench)
        reader.close()
        document = _document(bench, reader, happened, drives)
    passed_s = time.monotonic() - started
    progress(1.0, "")
    return {
        "schema_version": SCHEMA_VERSION,
        "seed": seed,
        "seconds": round(passed_s, 1),
        **document,
    }


def _drives(bench: Bench) -> bool:
    try:
        bench.arm()
    except KeyholeError:
        return False
    return True


def _document(
    bench: Bench, reader: Reader, happened: list[dict[str, Any]], drives: bool
) -> dict[str, Any]:
    told = bench.supervision()[0]
    killed = {
        "web": sum(one["fault"] == "web-killed" for one in happened),
        "control": sum(one["fault"] == "host-killed" for one in happened),
    }
    restarts = {name: int(told[f"{name}_restarts"]) for name in ("web", "control")}
    settings = bench.watch.newest()["input"]["settings"]
    # A control process that begins anew begins with the settings of the configuration.
    kept = killed["control"] > 0 or abs(float(settings["motion_scale"][0]) - _SCALE) < 1e-9
    memory = reader.memory.summary()
    largest = max((one["growth_mb"] for one in memory), default=0.0)
    checks = {
        "drives_at_the_end": drives,
        "supervisor_lives": bench.console.process.poll() is None,
        "no_unexpected_restart": restarts == killed,
        "records_without_gaps_and_explained": not reader.faults,
        "settings_kept": kept,
        "memory_flat": largest <= LARGEST_GROWTH_MB,
    }
    undetected = [one["fault"] for one in happened if not one["detected"]]
    return {
        "met": all(checks.values()),
        "checks": checks,
        "faults_injected": len(happened),
        "faults_as_demanded": sum(bool(one["met"]) for one in happened),
        "undetected": undetected,
        "restarts": restarts,
        "records": reader.records,
        "transitions": reader.transitions,
        "unexplained": reader.faults[:20],
        "largest_growth_mb": largest,
        "memory": memory,
        "faults": happened,
    }


def printed(document: dict[str, Any]) -> str:
    """What came of it, for people."""
    lines = [
        f"{'ok' if passed else '!!'} {name.replace('_', ' ')}"
        for name, passed in document["checks"].items()
    ]
    lines += [
        f"   {one['process']:<10} {one['pid']:>7}  {one['last_mb']:7.1f} MB, "
        f"{one['slope_mb_min']:+.2f} MB a minute"
        for one in document["memory"]
    ]
    lines += [f"!! {words}" for words in document["unexplained"]]
    lines.append(
        f"{document['faults_injected']} faults in {document['seconds']:.0f} s, "
        f"{document['faults_as_demanded']} as demanded, {len(document['undetected'])} undetected; "
        f"{document['records']} records, {document['transitions']} transitions"
    )
    return "\n".join(lines)
