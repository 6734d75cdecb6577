"""What the report runs of the two concentric-tube arms: one task a path, method and start."""

from __future__ import annotations

import csv
import functools
import hashlib
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from robot.calibration import Calibration
from robot.concentric.design import METHODS, Concentric, MethodName
from robot.configuration import Configuration
from scenes.experiments.tubes import NEAR_INFEASIBLE, RANDOM, TubeMotion, motions, starts
from server.run.figure_table import figure
from server.run.tube_figures import tube_document
from server.run.tube_run import TubeRun, TubeTask
from server.study.program_mark import program_mark
from server.study.work import Outcome, finished

PATHS = ("rectangle", "lissajous")
LINES = tuple(f"line {sign}{axis}" for axis in "xyz" for sign in "+−")
LINE_METHODS: tuple[MethodName, ...] = ("nspqp", "snsqp", "hqp")
LINE_MM = 60
LABELS: dict[str, str] = {name: name.upper() for name in METHODS}
LABELS["nspwln-repaired"] = "NSPWLN, repaired"
RANDOM_COUNT, RANDOM_SEED = 20, 2024
QUICK_POINTS, QUICK_COUNT = 6, 2
_POINTS = 100.0
_STALLS = 20.0
"""How much longer a run may take that tries 100 iterations a point."""
_MARK_LENGTH = 12

_COLUMNS = (
    *("experiment", "method", "configuration", "ended", "iterations", "converged_points", "points"),
    *(
        f"{error}.{key}"
        for error in ("relative_error_mm", "tracking_error_mm")
        for key in ("rms", "std", "max", "max_any_iteration")
    ),
    *("bound_violation_mm", "infeasible_qps", "peak_rotation_rad_s", "peak_translation_mm_s"),
    *("translation_total_mm", "stability_min", "task_scale_min"),
)


@dataclass(frozen=True)
class TubeWork:
    """One run of both arms.

    Attributes:
        experiment: name of the experiment.
        method: name of the method.
        start: name of the configuration it starts from.
        count: how many random starts there are; 0 where they are the paper's.
        seed: of the random starts.
        points: how many points of the path are played; None for all.
    """

    experiment: str
    method: str
    start: str
    count: int = 0
    seed: int = 0
    points: int | None = None

    def name(self, configuration: Configuration, calibration: str | None) -> str:
        """A name for files: the run, and a mark of all else that its result depends on."""
        whole = "\n".join([program_mark(), configuration.concentric.model_dump_json()])
        mark = hashlib.sha256(whole.encode()).hexdigest()[:_MARK_LENGTH]
        drawn = f"-of-{self.count}_seed-{self.seed}" if self.count else ""
        part = "" if self.points is None else f"_first-{self.points}-points"
        named = self.experiment.replace(" ", "").replace("−", "-")
        return f"{named}_{self.method}_start-{self.start}{drawn}{part}_{mark}"

    def words(self) -> str:
        """For people."""
        return f"{self.experiment}, {self.method}, start {self.start}"

    def weight(self, configuration: Configuration) -> float:
        """About how long it takes, against a path of 100 points that goes well."""
        if self.experiment in LINES:
            return 0.5
        long = _STALLS if (self.experiment, self.method) == (NEAR_INFEASIBLE, "nspqp") else 1.0
        return long * (self.points or _POINTS) / _POINTS

    def outcome(
        self,
        configuration: Configuration,
        calibration: Calibration | None,
        interrupted: Callable[[], bool],
    ) -> Outcome:
        """Run it.

        Args:
            configuration: its concentric tubes.
            calibration: of no meaning here.
            interrupted: asked at every point whether to stop.
        """
        design = configuration.concentric
        motion = _motion(self.experiment)
        start = _starts(design.model_dump_json(), self.experiment, self.count, self.seed)
        task = TubeTask(
            self.experiment,
            self.start,
            start[self.start],
            motion.offsets[: self.points],
            motion.relative_offset,
            stops_unreached=self.experiment in LINES,
        )
        traces = self.experiment in (NEAR_INFEASIBLE, *PATHS)
        run = TubeRun(design, task, self.method, traces)
        result = run.execute(lambda _: None, interrupted)
        if result.ended == "interrupted":
            return Outcome(None)
        packed = io.BytesIO()
        np.savez_compressed(packed, trace=np.array(result.trace, dtype=np.float32))
        return finished(tube_document(task, self.method, result), packed.getvalue())


def _motion(experiment: str) -> TubeMotion:
    """What A's tip does; a line goes straight on, 1 mm at a time, until it is stopped."""
    if experiment not in LINES:
        (motion,) = motions(experiment)
        return motion
    offsets = np.zeros((LINE_MM, 3))
    way = np.arange(1, LINE_MM + 1) * (1e-3 if experiment[-2] == "+" else -1e-3)
    offsets[:, "xyz".index(experiment[-1])] = way
    return TubeMotion(experiment, offsets)


@functools.lru_cache(maxsize=8)
def _starts(design: str, experiment: str, count: int, seed: int) -> dict[str, np.ndarray]:
    """Starts by name; a worker draws the random ones once."""
    return starts(experiment, Concentric.model_validate_json(design), count, seed)


def tube_tasks(configuration: Configuration, quick: bool) -> list[TubeWork]:
    """Everything that the report shows of the concentric tubes.

    Args:
        configuration: how many starts it has.
        quick: only the first points, and fewer random starts.
    """
    points = QUICK_POINTS if quick else None
    count = QUICK_COUNT if quick else RANDOM_COUNT
    own = [str(number) for number in range(1, len(configuration.concentric.starts) + 1)]
    drawn = [str(number) for number in range(1, count + 1)]
    return [
        *(
            TubeWork(experiment, method, start, points=points)
            for experiment in (NEAR_INFEASIBLE, *PATHS)
            for method in METHODS
            for start in own
        ),
        *(
            TubeWork(line, method, start, points=points)
            for line in LINES
            for method in LINE_METHODS
            for start in own
        ),
        *(
            TubeWork(RANDOM, method, start, count, RANDOM_SEED, points)
            for start in drawn
            for method in METHODS
        ),
    ]


def tube_csv(documents: Iterable[dict[str, Any]]) -> str:
    """A CSV with a row a run."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([name.replace(".", "_") for name in _COLUMNS])
    for document in documents:
        row = [figure(document, name) for name in _COLUMNS]
        writer.writerow(["" if value is None else value for value in row])
    return text.getvalue()
