"""Lateness of the control process beside an empty loop of the same rate and scheduling.

The machine itself is late now and then, so the figure that tells something is the difference. The
console runs all the time and plays a path, so that every tick does its full work; measurements of
the empty loop and of the console take turns, first without and then with a browser and stream
clients. The empty loop's deadlines lie half a period from the console's, so that the two never
ask for the processor at the same moment.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import numpy as np

from benchmarks.console import Console, ConsoleFailed, Helper
from robot.configuration import Configuration
from server.memory.run_directory import default_path

ROUNDS = 3
CLIENTS = 20
"""Stream clients beside the browser."""

_SETTLING_S = 1.0
_TURN_S = 1.0


@dataclass
class Samples:
    """What was measured of one loop under one condition."""

    lateness_ns: list[int] = field(default_factory=list)
    lost: int = 0
    stolen_ms: float = 0.0

    def figures(self) -> dict[str, Any]:
        """Percentiles in µs, and counts."""
        values = np.array(self.lateness_ns) * 1e-3
        p50, p99, p999 = np.percentile(values, [50, 99, 99.9]).round(1).tolist()
        return {
            "p50": p50,
            "p99": p99,
            "p99_9": p999,
            "max": round(float(values.max()), 1),
            "lost_ticks": self.lost,
            "ticks": len(values),
            "stolen_ms": round(self.stolen_ms, 1),
        }


class Bench:
    """The console, the empty loop, and what was measured of both.

    Args:
        console: running and enabled.
        empty: the empty loop's process.
        configuration: of the console.
        seconds: length of each measurement.
    """

    def __init__(
        self, console: Console, empty: Helper, configuration: Configuration, seconds: float
    ) -> None:
        self._console, self._empty = console, empty
        self._ring = console.ring()
        self._period_ns = round(1e9 / configuration.control.rate_hz)
        self._seconds = seconds
        self.samples: dict[str, dict[str, Samples]] = {}

    def measure(self, condition: str) -> None:
        """Measure the empty loop and the console in turns of about a second."""
        names = {"reference": self._measure_empty, "console": self._measure_console}
        both = self.samples.setdefault(condition, {name: Samples() for name in names})
        turns = max(1, round(self._seconds / _TURN_S))
        for _ in range(turns):
            for name, one in names.items():
                before = _stolen_ms()
                one(both[name], self._seconds / turns)
                both[name].stolen_ms += _stolen_ms() - before

    def _measure_empty(self, samples: Samples, seconds: float) -> None:
        newest, _, _ = self._ring.read_since(self._ring.sequence - 1)
        header = newest["header"][-1]
        # A tick is published when its work is done, some tens of µs after its deadline.
        phase = int(header["stamp_ns"] - header["tick_ns"] - header["lateness_ns"])
        order = {"phase_ns": (phase + self._period_ns // 2) % self._period_ns}
        self._empty.tell(json.dumps({**order, "seconds": seconds}))
        self._console.drive_on(seconds)
        answer = self._empty.answer()
        samples.lateness_ns += answer["lateness_ns"]
        samples.lost += answer["lost"]

    def _measure_console(self, samples: Samples, seconds: float) -> None:
        first = self._ring.sequence
        self._console.drive_on(seconds)
        records, _, gap = self._ring.read_since(first)
        if gap:
            raise ConsoleFailed("records were overwritten before they could be read")
        header = records["header"]
        samples.lateness_ns += header["lateness_ns"].tolist()
        samples.lost += int(header["overruns"][-1] - header["overruns"][0])


@contextlib.contextmanager
def _load(console: Console, told: dict[str, Any]) -> Iterator[None]:
    """Clients and browser attached for the length of the block; ``told`` takes what they say."""
    arguments = ["--base", console.base, "--clients", str(CLIENTS)]
    with Helper("benchmarks.console_load", arguments) as load:
        load.tell(console.token)
        told.update(load.answer())
        time.sleep(_SETTLING_S)
        yield
        load.end_of_input()
        told.update(load.answer())


def _stolen_ms() -> float:
    """Processor time that the host of this virtual machine has kept for others; 0 if unknown."""
    try:
        fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()
        return float(fields[8]) * 1000.0 / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return 0.0


def _say(message: str) -> None:
    print(f"keyhole: {message}", file=sys.stderr, flush=True)


def _end(number: int, _: FrameType | None) -> NoReturn:
    sys.exit(128 + number)


def measure(configuration: Configuration, seconds: float) -> dict[str, Any]:
    """Measure.

    Args:
        configuration: of the console.
        seconds: how long each of the four parts takes, over all rounds.

    Returns:
        Under ``idle`` and ``loaded``: ``reference`` and ``console``, each with lateness ``p50,
        p99, p99_9, max`` in µs, ``lost_ticks``, ``ticks``, and ``stolen_ms``, the processor time
        that a virtual machine's host kept for others meanwhile; ``p99_above_reference_us`` and
        ``lost_ticks_above_reference``. Under ``load`` what was attached.
    """
    # Ended by a signal, the console and the helpers must end too.
    signal.signal(signal.SIGTERM, _end)
    control = configuration.control
    rounds = max(ROUNDS, math.ceil(seconds / (0.8 * control.record_ring_seconds)))
    told: dict[str, Any] = {}
    loop_arguments = ["--rate-hz", str(control.rate_hz), "--realtime", control.realtime]
    with tempfile.TemporaryDirectory(dir=default_path().parent) as folder:
        written = Path(folder) / "configuration.json"
        written.write_text(configuration.model_dump_json())
        with (
            Console(Path(folder) / "run", str(written)) as console,
            Helper("benchmarks.empty_loop", loop_arguments) as empty,
            console.driving(),
        ):
            _say(f"the empty loop runs; real-time scheduling: {empty.answer()['realtime']}")
            bench = Bench(console, empty, configuration, seconds / rounds)
            for turn in range(1, rounds + 1):
                _say(f"round {turn} of {rounds}: without clients")
                bench.measure("idle")
                with _load(console, told):
                    _say(f"round {turn} of {rounds}: with {told}")
                    bench.measure("loaded")
            realtime = console.state()["loop"]["realtime"]
    figures = {"unit": "us", "rate_hz": control.rate_hz, "realtime": realtime}
    figures.update(cores=os.cpu_count(), seconds=seconds, rounds=rounds)
    figures.update({name: _compare(both) for name, both in bench.samples.items()})
    return {**figures, "load": told}


def _compare(both: dict[str, Samples]) -> dict[str, Any]:
    found: dict[str, Any] = {name: samples.figures() for name, samples in both.items()}
    console, reference = found["console"], found["reference"]
    found["p99_above_reference_us"] = round(console["p99"] - reference["p99"], 1)
    found["lost_ticks_above_reference"] = console["lost_ticks"] - reference["lost_ticks"]
    return found
