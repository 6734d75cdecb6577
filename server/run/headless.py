"""An experiment without a browser: the same loop, as fast as it goes or paced, and its trace."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hardware.choose import simulated_plant
from robot.calibration import Calibration
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.priority.limits import describe, speed_violations, violations
from robot.records import Request, Safety
from robot.safety import REASONS, Event
from robot.segment import polar
from robot.tension.feasibility import check_configured
from scenes.lead_in import anchored
from scenes.path import Path
from server.calibration.sweep import calibration_for
from server.control.instrument_loop import InstrumentLoop
from server.run.options import RunOptions, check_names

TRACE_COLUMNS = (
    ["time_s"]
    + [f"q{index}" for index in range(1, 8)]
    + ["theta_rad", "delta_rad", "lambda"]
    + [f"{who}_{axis}" for who in ("true", "desired")
       for axis in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")]
    + ["trocar_x_m", "trocar_y_m", "trocar_z_m"]
)  # fmt: skip

DETAIL_COLUMNS = (
    *("residual_rcm_m_s", "residual_linear_m_s", "residual_angular_rad_s"),
    *("contact_count", "contact_force_n", "rings_passed", "rings_touched", "ball_progress"),
    *("commanded_qw", "commanded_qx", "commanded_qy", "commanded_qz"),
    *("commanded_u_rad", "commanded_v_rad"),
    *("sensing_fault", "true_x_n", "true_y_n", "true_z_n"),
    *("estimated_x_n", "estimated_y_n", "estimated_z_n"),
)

SETTLING_S = 0.5
"""How long the plant stands before the trocar is registered and the robot enabled."""


@dataclass
class RunResult:
    """What came of a run.

    Attributes:
        trace: (steps, 28) rows with ``TRACE_COLUMNS``.
        detail: (steps, 21) rows with ``DETAIL_COLUMNS``.
        errors: (steps, 3) position in m, orientation in rad, RCM in m, against the truth.
        tick_ns: (steps,) time of the controller's tick.
        realtime_factor: plant time over wall time, controller and plant together.
        violations: ticks in which the command broke a limit.
        true_violations: ticks in which the robot stood outside one; a real one does not stand
            exactly where it is told.
        limits: the limits that held the motion back, in words, with the share of ticks.
        ended: ``completed``, ``interrupted``, or the reason of the stop.
    """

    trace: np.ndarray
    detail: np.ndarray
    errors: np.ndarray
    tick_ns: np.ndarray
    realtime_factor: float = 0.0
    violations: int = 0
    true_violations: int = 0
    limits: dict[str, float] = field(default_factory=dict)
    ended: str = "completed"


class _Pace:
    """Holds ticks to the wall clock; what was late is not caught up with."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._deadline = time.perf_counter()

    def wait(self) -> None:
        """Sleep until the next deadline."""
        now = time.perf_counter()
        self._deadline += self._period_s
        if self._deadline > now:
            time.sleep(self._deadline - now)
        else:
            self._deadline = now


def _trace_row(record: np.void, time_s: float, out: np.ndarray) -> None:
    truth, report = record["truth"], record["outcome"]["report"]
    out[0] = time_s
    out[1:8] = truth["q"]
    out[8], out[9] = polar(truth["uv"][0], truth["uv"][1])
    out[10] = truth["lambda_along_shaft"]
    out[11:14], out[14:18] = truth["position"], truth["wxyz"]
    out[18:21], out[21:25] = report["desired_position"], report["desired_wxyz"]
    out[25:28] = truth["trocar_position"]


def _detail_row(record: np.void, out: np.ndarray) -> None:
    truth, report = record["truth"], record["outcome"]["report"]
    out[0], out[1] = report["residual_rcm"], report["residual_linear"]
    out[2] = report["residual_angular"]
    out[3], out[4] = truth["contact_count"], truth["contact_force"]
    out[5], out[6] = truth["rings_passed"], truth["rings_touched"]
    out[7] = truth["ball_progress"]
    out[8:12], out[12:14] = report["commanded_wxyz"], report["x"][7:9]
    out[14], out[15:18] = report["estimate_fault"], truth["contact_wrench"][:3]
    out[18:21] = report["estimate_force"]


class HeadlessRun:
    """One run: robot, plant and loop, from the configuration's start.

    Attributes:
        configuration: the one in force, with the options in it.
        calibration: the one in force.
        steps: ticks of the path.
        dt_s: length of a tick.
    """

    def __init__(
        self,
        configuration: Configuration,
        options: RunOptions,
        calibration: Calibration | None = None,
        progress: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Build everything.

        Args:
            configuration: what the options leave open.
            options: what to run.
            calibration: of the robot's tendons; without one the robot is calibrated first, if its
                tendons are to be compensated.
            progress: called with the share of that which is done.

        Raises:
            KeyholeError: a name is unknown, or the start cannot be reached.
        """
        check_names(options)
        self.options = options
        self.configuration = configuration = options.applied(configuration)
        check_configured(configuration)
        self.calibration = calibration or calibration_for(configuration, progress)
        self._robot = InstrumentRobot(configuration, self.calibration)
        x = self._robot.initial_state()["x"][0]
        self._plant = simulated_plant(configuration, x)
        self._loop = InstrumentLoop(self._robot, self._plant, configuration)
        self.steps = math.ceil(options.path.duration_s * configuration.control.rate_hz) + 1
        self.dt_s = 1.0 / configuration.control.rate_hz

    def execute(
        self,
        progress: Callable[[float], None],
        interrupted: Callable[[], bool],
        record: Callable[[np.ndarray], None] | None = None,
    ) -> RunResult:
        """Run to the end, a stop, or an interruption; what was reached by then is returned.

        Args:
            progress: called now and then with the share done.
            interrupted: asked every tick whether to stop.
            record: called after every tick, those before the path too, with the (1,)
                ``robot.records.RECORD``, whose memory the next tick uses again.
        """
        try:
            self._settle(record)
            return self._play(progress, interrupted, record)
        finally:
            self._plant.close()

    def _settle(self, record: Callable[[np.ndarray], None] | None) -> None:
        """Let the plant come to rest under its weight, register the trocar, and enable."""
        loop = self._loop
        loop.hold = 1  # a run has nobody who could keep the hold-to-move key down
        for _ in range(round(SETTLING_S / self.dt_s)):
            loop.step()
            if record is not None:
                record(loop.record)
        self._plant.register_trocar(loop.trocar_position)
        loop.request = Request.ENABLE
        loop.step()
        if record is not None:
            record(loop.record)

    def _play(
        self,
        progress: Callable[[float], None],
        interrupted: Callable[[], bool],
        record: Callable[[np.ndarray], None] | None,
    ) -> RunResult:
        loop = self._loop
        result = self._empty()
        held_back: dict[str, int] = {}
        pace = _Pace(self.dt_s) if self.options.realtime else None
        path, way_in_s = self._path_from_here()
        loop.start_path(path, lock_arm=self.options.lock_arm)
        done, started = 0, time.perf_counter()
        left = round(way_in_s / self.dt_s)
        while loop.path is not None and done < self.steps:
            loop.step()
            if record is not None:
                record(loop.record)
            state = loop.record["outcome"]["state"][0]
            if state["safety"] != Safety.ENABLED:
                result.ended = REASONS[Event(int(state["reason"]))][0]
                break
            if left > 0:
                left -= 1
            else:
                self._take_down(done, result, held_back)
                done += 1
            if done == 1:  # the first tick may have to load compiled functions
                started = time.perf_counter()
            if done % 100 == 0:
                progress(done / self.steps)
            if interrupted():
                result.ended = "interrupted"
                break
            if pace is not None:
                pace.wait()
        passed = max(done - 1, 0) * self.dt_s
        result.realtime_factor = passed / max(time.perf_counter() - started, 1e-9)
        result.trace, result.errors = result.trace[:done], result.errors[:done]
        result.detail, result.tick_ns = result.detail[:done], result.tick_ns[:done]
        result.limits = {
            words: round(count / done, 4) for words, count in sorted(held_back.items())
        }
        return result

    def _path_from_here(self) -> tuple[Path, float]:
        """The path, and how long the way in to its start takes, s, before errors count.

        What stands where the configuration's start is (boards) has to be met from there. The exact
        plant is there already.
        """
        path = self.options.path
        if not self.options.from_start or self.configuration.simulation.plant == "kinematic":
            return path, 0.0
        here = self._loop.record["outcome"]["state"][0]
        start = self._robot.initial_state()[0]
        return anchored(
            path,
            start["tip_position"],
            start["tip_rotation"],
            here["desired_position"],
            here["desired_rotation"],
        )

    def _empty(self) -> RunResult:
        return RunResult(
            np.zeros((self.steps, len(TRACE_COLUMNS))),
            np.zeros((self.steps, len(DETAIL_COLUMNS))),
            np.zeros((self.steps, 3)),
            np.zeros(self.steps, dtype=np.int64),
        )

    def _take_down(self, place: int, result: RunResult, held_back: dict[str, int]) -> None:
        """Write the newest record into row ``place`` of the result."""
        record = self._loop.record[0]
        truth, report = record["truth"], record["outcome"]["report"]
        _trace_row(record, place * self.dt_s, result.trace[place])
        _detail_row(record, result.detail[place])
        errors = truth["position_error"], truth["orientation_error"], truth["rcm_error"]
        result.errors[place] = errors
        result.tick_ns[place] = record["header"]["tick_ns"]
        result.violations += self._breaks_a_limit(report["x"], report["x_dot"])
        truly = np.array([*truth["q"], *truth["uv"], truth["lambda_along_shaft"]])
        result.true_violations += self._breaks_a_limit(truly, report["x_dot"])
        limits = int(report["limits_active"])
        if limits:
            for words in describe(limits, report["x"], self._robot.parameters):
                held_back[words] = held_back.get(words, 0) + 1

    def _breaks_a_limit(self, x: np.ndarray, x_dot: np.ndarray) -> int:
        broken = violations(x, self._robot.parameters)
        broken += speed_violations(x_dot, self._robot.parameters)
        return int(broken > 0)
