"""The whole console on a servo bus, led by a stylus: how fast the bus turns, how late a hand comes.

The servos are the simulated ones at a pseudo-terminal and the stylus plays circles through a
rosbridge, so that everything between them is what drives a real robot. A packet's latency is
counted from the stylus' own stamp to the moment at which the first goals that know of it have left
for the servos. It stands beside the time that a packet would wait on average if nothing took any
time: half a tick and half a bus cycle.
"""

from __future__ import annotations

import os
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.percentiles import percentiles
from robot.configuration import Configuration
from robot.records import LeaderKind, Safety
from server.faults.bench import Bench

_ROUND_S = 2.0
_SETTLING_S = 1.0


def latencies_ns(
    samples: NDArray[np.int64], ticks: NDArray[np.int64], goals: NDArray[np.int64]
) -> NDArray[np.int64]:
    """From each sample to the first goals written after the tick that took it in.

    Args:
        samples: (n,) the stylus' stamp of the sample that each tick followed, ns.
        ticks: (n,) when each tick was published, ns, increasing.
        goals: (m,) when goals had been written, ns, increasing.

    Returns:
        One latency for each sample that a tick took in before the last goals, ns.
    """
    new = np.flatnonzero(np.diff(samples, prepend=samples[:1] - 1) > 0)
    place = np.searchsorted(goals, ticks[new])
    known = place < len(goals)
    return np.asarray(goals[place[known]] - samples[new[known]])


def _round(bench: Bench) -> NDArray[np.int64]:
    """Latencies of one round."""
    assert bench.servos is not None
    bench.watch.mark()
    began = time.monotonic_ns()
    time.sleep(_ROUND_S)
    goals = np.array([row[0] for row in bench.servos.goals(began)], dtype=np.int64)
    records = bench.watch.records()
    leader = records["input"]["leader"]
    led = (leader["kind"] == LeaderKind.STYLUS) & (records["outcome"]["command"]["moving"] == 1)
    records = records[led]
    samples, ticks = records["input"]["leader"]["sequence"], records["header"]["stamp_ns"]
    return latencies_ns(samples, ticks, goals)


def _cpu_s(pid: int) -> float:
    """Processor time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(configuration: Configuration, seconds: float) -> dict[str, Any]:
    """Drive circles for about ``seconds``.

    Returns:
        Figures of the bus, of the way from stylus to servos, and of the control loop beside them.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        bench = stack.enter_context(Bench(folder / "console", configuration, hardware=True))
        bench.arm()
        time.sleep(_SETTLING_S)
        control = bench.pid("control")
        began, used = time.monotonic(), _cpu_s(control)
        rounds, rates, driver, stops = [], [], [], []
        while time.monotonic() < began + seconds:
            rounds.append(_round(bench))
            bus = bench.devices()["bus"]
            rates.append(float(bus["rate_hz"]))
            driver.append(float(bus["cpu_percent"]))
            if bench.now()[0] != Safety.ENABLED:
                stops.append(bench.now()[1].name)
                bench.arm()
        share = (_cpu_s(control) - used) / (time.monotonic() - began)
        bus, late = bench.devices()["bus"], bench.watch.records()["header"]["lateness_ns"]
    way = np.concatenate(rounds)
    waiting = 0.5e3 / configuration.control.rate_hz + 0.5e3 / configuration.servos.rate_hz
    return {
        "benchmark": "hardware",
        "baud_rate": configuration.servos.baud_rate,
        "bus": {
            "rate_hz": round(float(np.median(rates)), 1),
            "lowest_rate_hz": round(min(rates), 1),
            "cycle_median_ms": round(float(bus["cycle_median_ms"]), 3),
            "cycle_p99_ms": round(float(bus["cycle_p99_ms"]), 3),
            "missed": int(bus["missed"]),
            "driver_cpu_percent": round(float(np.median(driver)), 1),
        },
        "stylus_to_servo_us": percentiles(way),
        "waiting_ms": round(waiting, 3),
        "ratio": round(1e-6 * float(np.median(way)) / waiting, 3),
        "samples": len(way),
        "stops": stops,
        "control_cpu_percent": round(100.0 * share, 1),
        "lateness_us": percentiles(late),
    }
