"""What the report runs of shape and force sensing: one task an experiment, noise and seed."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from robot.calibration import Calibration
from robot.configuration import Configuration
from scenes.experiments.sensing import (
    CHIRP,
    COVERAGE,
    FORCE_LEVELS,
    PULL_RELEASE,
    SHAPE_FREE,
)
from server.run.figure_table import figure
from server.run.sensing_chirp import chirp_run
from server.run.sensing_coverage import run_coverage
from server.run.sensing_figures import coverage_document, sensing_document
from server.run.sensing_options import FRICTION, SAMPLES, TENSION_NOISE_N, TRIALS, SensingOptions
from server.run.sensing_run import run_sensing
from server.run.sensing_traces import coverage_arrays, packed, sensing_arrays
from server.study.program_mark import program_mark
from server.study.work import Outcome, finished

NOTHING, QUIET, NOISY, LOUD = (0.0, 0.0), (0.1, 0.25), (0.25, 0.5), (0.5, 1.0)
NOISES = (NOTHING, QUIET, NOISY, LOUD)
"""Pose noise in mm and deg; targets are at the middle two, and run with every seed."""
TENSIONS_N = (0.005, 0.05, 0.15)
"""Other noises of a tension, at the larger of the two; the last is a cell without any mean."""
SEEDS = (1, 2, 3, 4, 5)
QUICK_SAMPLES, QUICK_TRIALS = 5, 5
_MARK_LENGTH = 12
_COLUMNS = (
    *("experiment", "seed", "friction", "noise.position_mm", "noise.angle_deg"),
    *("noise.tension_n", "ended"),
    *("shape_error_mm.rms", "shape_error_mm.mean", "shape_error_mm.max"),
    *("polynomial_curvature.shape_error_mm.rms", "constant_curvature.shape_error_mm.rms"),
    *("force_error_n.rms", "force_error_percent.rms", "mean_of_20.force_error_percent.rms"),
    *("calibrated.stiffness_error_percent", "calibrated.friction_error_percent"),
    *("axis_known.inside_percent", "axis_free.inside_percent", "trials"),
)


@dataclass(frozen=True)
class SensingWork:
    """One run.

    Attributes:
        experiment: its name.
        noise: of the pose, mm and deg.
        friction: nominal.
        seed: of the rod and of all noise.
        count: samples of each bend or level, or trials.
        tension: noise of a tension, N.
    """

    experiment: str
    noise: tuple[float, float] = QUIET
    friction: float = FRICTION
    seed: int = 1
    count: int = SAMPLES
    tension: float = TENSION_NOISE_N

    def options(self) -> SensingOptions:
        """What is run."""
        return SensingOptions(
            self.experiment,
            *self.noise,
            self.friction,
            self.seed,
            self.count,
            self.count,
            self.tension,
        )

    def name(self, configuration: Configuration, calibration: str | None) -> str:
        """A name for files: the run, and a mark of the program that its result depends on."""
        unit = configuration.tension_unit.model_dump_json() if self.experiment == CHIRP else ""
        whole = "\n".join([program_mark(), unit])
        mark = hashlib.sha256(whole.encode()).hexdigest()[:_MARK_LENGTH]
        noise = f"noise-{self.noise[0]:g}-{self.noise[1]:g}"
        own = f"{noise}-{self.tension:g}_friction-{self.friction:g}_seed-{self.seed}"
        own += f"_count-{self.count}"
        return f"{self.experiment}_{own}_{mark}"

    def words(self) -> str:
        """As on the command line."""
        if self.experiment == CHIRP:
            return f"{self.experiment} --seed {self.seed}"
        return (
            f"{self.experiment} --noise {self.noise[0]:g},{self.noise[1]:g} "
            f"--tension-noise {self.tension:g} --friction {self.friction:g} --seed {self.seed}"
        )

    def weight(self, configuration: Configuration) -> float:
        """About how long it takes, in seconds."""
        return 0.1 * self.count if self.experiment == COVERAGE else 0.2 + 0.006 * self.count

    def outcome(
        self,
        configuration: Configuration,
        calibration: Calibration | None,
        interrupted: Callable[[], bool],
    ) -> Outcome:
        """Run it.

        Args:
            configuration: of the tension unit; every rod is drawn.
            calibration: likewise; every rod is calibrated.
            interrupted: asked now and then whether to stop.
        """
        options = self.options()
        if self.experiment == CHIRP:
            document, arrays = chirp_run(configuration.tension_unit, self.seed)
            return finished(document, packed(arrays))
        if self.experiment == COVERAGE:
            covered = run_coverage(options, lambda _: None, interrupted)
            if covered.ended != "completed":
                return Outcome(None)
            document = coverage_document(options, covered)
            return finished(document, packed(coverage_arrays(covered)))
        result = run_sensing(options, lambda _: None, interrupted)
        if result.ended != "completed":
            return Outcome(None)
        return finished(sensing_document(options, result), packed(sensing_arrays(options, result)))


def sensing_tasks(quick: bool) -> list[SensingWork]:
    """Everything that the report shows of sensing.

    Args:
        quick: one seed, a few samples and trials.
    """
    samples = QUICK_SAMPLES if quick else SAMPLES
    trials = QUICK_TRIALS if quick else TRIALS // len(SEEDS)
    seeds = SEEDS[:1] if quick else SEEDS
    found = [SensingWork(COVERAGE, NOISY, FRICTION, seed, trials) for seed in seeds]
    found += [SensingWork(CHIRP, count=1), SensingWork(PULL_RELEASE, count=1)]
    found += [
        SensingWork(FORCE_LEVELS, NOISY, FRICTION, seeds[0], samples, tension)
        for tension in TENSIONS_N
    ]
    for noise in NOISES:
        own = seeds if noise in (QUIET, NOISY) else seeds[:1]
        for seed in own:
            found.append(SensingWork(FORCE_LEVELS, noise, FRICTION, seed, samples))
            found += [
                SensingWork(SHAPE_FREE, noise, friction, seed, samples)
                for friction in (0.0, FRICTION)
            ]
    return found


def sensing_csv(documents: Iterable[dict[str, Any]]) -> str:
    """A CSV with a row a run."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([name.replace(".", "_") for name in _COLUMNS])
    for document in documents:
        row = [figure(document, name) for name in _COLUMNS]
        writer.writerow(["" if value is None else value for value in row])
    return text.getvalue()
