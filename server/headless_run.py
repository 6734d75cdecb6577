"""An experiment without a browser: the same loop, as fast as it goes, and the figures of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hardware.kinematic_plant import KinematicPlant
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.priority.levels import case_named
from robot.priority.limits import describe, speed_violations, violations
from robot.records import Request, Safety
from robot.safety import REASONS, Event
from robot.segment import polar
from scenes.path import Path
from server.control.loop import COORDINATE_NAMES, SOLVER_NAMES, ControlLoop

TRACE_COLUMNS = (
    ["time_s"]
    + [f"q{index}" for index in range(1, 8)]
    + ["theta_rad", "delta_rad", "lambda"]
    + [f"{who}_{axis}" for who in ("true", "desired")
       for axis in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")]
    + ["trocar_x_m", "trocar_y_m", "trocar_z_m"]
)  # fmt: skip


@dataclass(frozen=True)
class RunOptions:
    """What to run.

    Attributes:
        experiment: its name, for the result.
        path: what the tip shall do.
        case: name of the priority case.
        solver: name of the solver.
        coordinates: name of the segment coordinates.
    """

    experiment: str
    path: Path
    case: str
    solver: str
    coordinates: str


@dataclass
class RunResult:
    """What came of a run.

    Attributes:
        trace: (steps, 28) rows with ``TRACE_COLUMNS``.
        errors: (steps, 3) position in m, orientation in rad, RCM in m, against the truth.
        tick_ns: (steps,) time of the controller's tick.
        violations: ticks in which a limit was broken.
        limits: the limits that held the motion back, in words, with the share of ticks.
        ended: ``completed``, ``interrupted``, or the reason of the stop.
    """

    trace: np.ndarray
    errors: np.ndarray
    tick_ns: np.ndarray
    violations: int = 0
    limits: dict[str, float] = field(default_factory=dict)
    ended: str = "completed"


def _trace_row(record: np.void, time_s: float, out: np.ndarray) -> None:
    truth, report = record["truth"], record["outcome"]["report"]
    out[0] = time_s
    out[1:8] = truth["q"]
    out[8], out[9] = polar(truth["uv"][0], truth["uv"][1])
    out[10] = truth["lambda_along_shaft"]
    out[11:14], out[14:18] = truth["position"], truth["wxyz"]
    out[18:21], out[21:25] = report["desired_position"], report["desired_wxyz"]
    out[25:28] = record["input"]["trocar_position"]


class HeadlessRun:
    """One run: robot, plant and loop, from the configuration's start."""

    def __init__(self, configuration: Configuration, options: RunOptions) -> None:
        """Build everything; raises the errors of configuration and names."""
        self._options = options
        self._robot = InstrumentRobot(configuration)
        x = self._robot.initial_state()["x"][0]
        self._loop = ControlLoop(self._robot, KinematicPlant(configuration, x), configuration)
        settings = self._loop.settings
        settings["case"] = case_named(options.case)
        settings["solver"] = SOLVER_NAMES[options.solver]
        settings["coordinates"] = COORDINATE_NAMES[options.coordinates]
        self.steps = math.ceil(options.path.duration_s * configuration.control.rate_hz) + 1
        self.dt_s = 1.0 / configuration.control.rate_hz

    def execute(
        self, progress: Callable[[float], None], interrupted: Callable[[], bool]
    ) -> RunResult:
        """Run to the end, a stop, or an interruption; what was reached by then is returned.

        Args:
            progress: called now and then with the share done.
            interrupted: asked every tick whether to stop.
        """
        loop, record = self._loop, self._loop.record[0]
        result = RunResult(
            np.zeros((self.steps, len(TRACE_COLUMNS))),
            np.zeros((self.steps, 3)),
            np.zeros(self.steps, dtype=np.int64),
        )
        held_back: dict[str, int] = {}
        loop.hold = 1  # a run has nobody who could keep the hold-to-move key down
        loop.request = Request.ENABLE
        loop.step()
        loop.start_path(self._options.path)
        done = 0
        while loop.path is not None and done < self.steps:
            loop.step()
            state, report = record["outcome"]["state"], record["outcome"]["report"]
            if state["safety"] != Safety.ENABLED:
                result.ended = REASONS[Event(int(state["reason"]))][0]
                break
            _trace_row(record, done * self.dt_s, result.trace[done])
            truth = record["truth"]
            result.errors[done] = (
                truth["position_error"],
                truth["orientation_error"],
                truth["rcm_error"],
            )
            result.tick_ns[done] = record["header"]["tick_ns"]
            result.violations += self._breaks_a_limit(truth, report["x_dot"])
            for words in describe(
                int(report["limits_active"]), report["x"], self._robot.parameters
            ):
                held_back[words] = held_back.get(words, 0) + 1
            done += 1
            if done % 500 == 0:
                progress(done / self.steps)
            if interrupted():
                result.ended = "interrupted"
                break
        result.trace, result.errors = result.trace[:done], result.errors[:done]
        result.tick_ns = result.tick_ns[:done]
        result.limits = {
            words: round(count / done, 4) for words, count in sorted(held_back.items())
        }
        return result

    def _breaks_a_limit(self, truth: np.void, x_dot: np.ndarray) -> int:
        x = np.array([*truth["q"], *truth["uv"], truth["lambda_along_shaft"]])
        broken = violations(x, self._robot.parameters)
        broken += speed_violations(x_dot, self._robot.parameters)
        return int(broken > 0)


def _summary(values: np.ndarray, factor: float) -> dict[str, float | None]:
    if len(values) == 0:
        return {"max": None, "rms": None, "final": None}
    return {
        "max": float(values.max() * factor),
        "rms": float(np.sqrt(np.mean(values**2)) * factor),
        "final": float(values[-1] * factor),
    }


def result_document(
    configuration: Configuration, options: RunOptions, result: RunResult, plant: str
) -> dict[str, Any]:
    """The run's figures as a JSON document; lengths in mm, angles in degrees, times as named."""
    steps = len(result.trace)
    reference = configuration.priority.lambda_reference
    dt_s = 1.0 / configuration.control.rate_hz
    bend = np.degrees(0.5 * math.pi - result.trace[:, 8])
    lambdas = np.abs(result.trace[:, 10] - reference)
    ticks = result.tick_ns * 1e-3
    degrees = 180.0 / math.pi
    return {
        "experiment": options.experiment,
        "case": options.case,
        "solver": options.solver,
        "coordinates": options.coordinates,
        "plant": plant,
        "steps": steps,
        "dt_s": dt_s,
        "duration_s": float(result.trace[-1, 0]) if steps else 0.0,
        "ended": result.ended,
        "errors": {
            "position_mm": _summary(result.errors[:, 0], 1e3),
            "orientation_deg": _summary(result.errors[:, 1], degrees),
            "rcm_mm": _summary(result.errors[:, 2], 1e3),
        },
        "lambda": {
            "reference": reference,
            "max_abs_error": float(lambdas.max()) if steps else None,
        },
        "bend_deg": {"max": float(bend.max()) if steps else None},
        "limits": {"violations": result.violations, "held_back": result.limits},
        "tick_us": {
            "p50": float(np.percentile(ticks, 50)) if steps else None,
            "p99": float(np.percentile(ticks, 99)) if steps else None,
        },
        "configuration_hash": f"{configuration.hash64():016x}",
    }
