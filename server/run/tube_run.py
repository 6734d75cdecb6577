"""Two concentric-tube arms on a path, headless: the inner loop of the paper, and what it did.

Paper 2 (Alsaka, Cinquin & Chikhaoui 2024), section 3: for each point at most 100 iterations of
0.1 s, or until A's tip is within 0.88 mm; the relative position of the start is to be kept.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from robot.concentric.control import ControlReport, ControlStatus, PairControl
from robot.concentric.design import Concentric
from robot.concentric.kinematics import SOLVED
from robot.concentric.methods.rate_problem import RateProblem
from robot.concentric.pair import PairKinematics
from robot.concentric.tubes import check_configuration
from robot.errors import KeyholeError

PERIOD_S = 0.1
ITERATIONS_MAX = 100
REACHED_M = 0.88e-3
"""Tracking error of A at which a point counts as reached."""


class UnreachablePath(KeyholeError):
    """A point of a path is further from the channel than any tube is long, or behind its exit.

    Attributes:
        point: number of the point, from 1.
    """

    code = "unreachable_path"

    def __init__(self, point: int, detail: str) -> None:
        super().__init__(f"point {point} of the path cannot be reached: {detail}; leave it out")
        self.point = point


class UnsolvedTubeStart(KeyholeError):
    """The tubes' torsion has no solution where a run shall begin."""

    code = "unsolved_tube_start"

    def __init__(self, configuration: str) -> None:
        super().__init__(
            f"configuration {configuration}: the tubes cannot stand there; change its start"
        )


@dataclass(frozen=True)
class TubeTask:
    """What both arms shall do.

    Attributes:
        experiment: name of the experiment, for the result.
        configuration: name of the start, for the result.
        start: (4n,) q_AB of the start, m and rad.
        offsets: (points, 3) where A's tip shall go, from its first position, m.
        relative_offset: (3,) by how much x_AB shall differ from that of the start, m.
        stops_unreached: whether a point that is not reached ends the run.
    """

    experiment: str
    configuration: str
    start: np.ndarray
    offsets: np.ndarray
    relative_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stops_unreached: bool = False


@dataclass
class TubeResult:
    """What came of a run; per point, and per inner iteration.

    Attributes:
        reached: whether each point begun was reached.
        point_relative: ‖ε_AB‖ when each point was left, m.
        point_tracking: ‖ε_A‖ then, m.
        relative: ‖ε_AB‖ after each iteration, m.
        tracking: ‖ε_A‖ after each iteration, m.
        time_ns: time of each iteration.
        statuses: how often each status came.
        travelled: (2n,) way of each tube's translation, A then B, m.
        bound_violation: largest, m.
        peak_rotation: rad/s.
        peak_translation: m/s.
        stability: smallest determinant of either arm.
        scale: smallest task scale.
        trace: a row an iteration, see :func:`trace_columns`; empty where none was asked for.
        ended: ``completed``, ``interrupted`` or ``unreached``.
    """

    tubes: int
    reached: list[bool] = field(default_factory=list)
    point_relative: list[float] = field(default_factory=list)
    point_tracking: list[float] = field(default_factory=list)
    relative: list[float] = field(default_factory=list)
    tracking: list[float] = field(default_factory=list)
    time_ns: list[int] = field(default_factory=list)
    statuses: dict[ControlStatus, int] = field(default_factory=dict)
    travelled: np.ndarray = field(init=False)
    bound_violation: float = 0.0
    peak_rotation: float = 0.0
    peak_translation: float = 0.0
    stability: float = float("inf")
    scale: float = 1.0
    trace: list[np.ndarray] = field(default_factory=list)
    ended: str = "completed"

    def __post_init__(self) -> None:
        self.travelled = np.zeros(2 * self.tubes)


def trace_columns(tubes: int) -> list[str]:
    """Names of the columns of a trace: an inner iteration a row."""
    arms = [f"{arm}{tube}" for arm in "ab" for tube in range(1, tubes + 1)]
    return [
        *("point", "iteration", "status", "relative_error_mm", "tracking_error_mm"),
        *(f"beta_{name}_mm" for name in arms),
        *(f"alpha_{name}_deg" for name in arms),
        *(f"least_{name}_mm" for name in arms),
        *(f"largest_{name}_mm" for name in arms),
        *(f"{axis}_{arm}_mm" for arm in "ab" for axis in "xyz"),
        *("scale_relative", "scale_tracking", "stability_a", "stability_b"),
    ]


class TubeRun:
    """One run of one method from one start.

    Attributes:
        task: what to do.
        method: name of the method.
    """

    def __init__(
        self, design: Concentric, task: TubeTask, method: str, traces: bool = False
    ) -> None:
        """Stand at the start.

        Args:
            design: tubes, gains and limits.
            task: what to do.
            method: name of the method.
            traces: whether to keep a row of every inner iteration.

        Raises:
            UnknownName: no such method.
            TubeOutOfBounds: the start is outside of (1).
            UnsolvedTubeStart: the tubes cannot stand there.
            UnreachablePath: a point that no tube can reach.
        """
        self.task, self.method, self._traces = task, method, traces
        self._control = PairControl(design, PERIOD_S, method)
        n = self._control.pair.count
        for arm in range(2):
            check_configuration(
                task.start[2 * n * arm : 2 * n * (arm + 1)], self._control.pair.tubes
            )
        self._now, self._after = PairKinematics(n), PairKinematics(n)
        self._report = ControlReport(n)
        self._bounds = RateProblem(self._control.proximal, 1.0, PERIOD_S)
        self._now.q[:] = task.start
        if self._control.pair.evaluate_cold(self._now) != SOLVED:
            raise UnsolvedTubeStart(task.configuration)
        self._first = self._now.position[0].copy()
        self._relative = self._now.relative + np.array(task.relative_offset)
        self._refuse_out_of_reach()

    def _refuse_out_of_reach(self) -> None:
        pair = self._control.pair
        longest = float(pair.tubes["length"][0])
        for number, offset in enumerate(self.task.offsets, 1):
            away = self._first + offset - pair.channels[0]
            distance = float(np.linalg.norm(away))
            if distance > longest:
                raise UnreachablePath(
                    number,
                    f"it is {1e3 * distance:.1f} mm from the channel of A, whose longest tube has "
                    f"{1e3 * longest:.1f} mm",
                )
            if away[2] < 0.0:
                raise UnreachablePath(
                    number, f"it lies {-1e3 * away[2]:.1f} mm behind the endoscope's face"
                )

    def execute(
        self, progress: Callable[[float], None], interrupted: Callable[[], bool]
    ) -> TubeResult:
        """Run to the end, or until interrupted; what was reached by then is returned.

        Args:
            progress: called after each point with the share done.
            interrupted: asked after each point whether to stop.
        """
        result = TubeResult(self._control.pair.count)
        result.stability = float(self._now.stability.min())
        self._warm_up()
        for number, offset in enumerate(self.task.offsets, 1):
            reached = self._go_to(number, self._first + offset, result)
            result.reached.append(reached)
            result.point_relative.append(result.relative[-1])
            result.point_tracking.append(result.tracking[-1])
            progress(number / len(self.task.offsets))
            if not reached and self.task.stops_unreached:
                result.ended = "unreached"
                break
            if interrupted():
                result.ended = "interrupted"
                break
        return result

    def _warm_up(self) -> None:
        """Let compiled functions load before iterations are timed; nothing moves."""
        self._control.step(
            self._now, self._first, self._relative, np.zeros(3), self._after, self._report
        )

    def _go_to(self, number: int, desired: np.ndarray, result: TubeResult) -> bool:
        """The inner loop of one point."""
        still = np.zeros(3)
        for iteration in range(1, ITERATIONS_MAX + 1):
            began = time.perf_counter_ns()
            status = self._control.step(
                self._now, desired, self._relative, still, self._after, self._report
            )
            result.time_ns.append(time.perf_counter_ns() - began)
            self._take_down(status, result)
            self._now, self._after = self._after, self._now
            if self._traces:
                result.trace.append(self._trace_row(number, iteration))
            if result.tracking[-1] < REACHED_M:
                return True
        return False

    def _take_down(self, status: ControlStatus, result: TubeResult) -> None:
        report, n = self._report, self._control.pair.count
        result.statuses[status] = result.statuses.get(status, 0) + 1
        result.relative.append(float(np.linalg.norm(report.relative_after)))
        result.tracking.append(float(np.linalg.norm(report.tracking_after)))
        moved = np.abs(self._after.q - self._now.q).reshape(2, 2 * n)[:, :n]
        result.travelled += moved.ravel()
        result.bound_violation = max(result.bound_violation, report.bound_violation)
        result.peak_rotation = max(result.peak_rotation, report.peak_rotation)
        result.peak_translation = max(result.peak_translation, report.peak_translation)
        result.stability = min(result.stability, float(self._after.stability.min()))
        result.scale = min(result.scale, float(report.scales.min()))

    def _trace_row(self, number: int, iteration: int) -> np.ndarray:
        now, report, n = self._now, self._report, self._control.pair.count
        self._bounds.stand_at(now.q)
        q = now.q.reshape(2, 2, n)
        return np.concatenate(
            [
                [number, iteration, report.status],
                [1e3 * np.linalg.norm(report.relative_after)],
                [1e3 * np.linalg.norm(report.tracking_after)],
                1e3 * q[:, 0].ravel(),
                np.degrees(q[:, 1]).ravel(),
                1e3 * self._bounds.least.ravel(),
                1e3 * self._bounds.largest.ravel(),
                1e3 * now.position.ravel(),
                report.scales,
                now.stability,
            ]
        )
