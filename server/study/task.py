"""What a study consists of: one task a run, named by everything that its result depends on."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from robot.calibration import Calibration
from robot.configuration import Configuration
from scenes.experiments import experiment
from server.run.figures import result_document
from server.run.headless import HeadlessRun
from server.run.options import RunOptions, cut, options_for
from server.study.program_mark import program_mark
from server.study.work import Outcome, finished, packed_trace

_MARK_LENGTH = 12


@dataclass(frozen=True)
class Task:
    """One run of the instrument.

    Attributes:
        experiment: name of the experiment.
        case: name of the priority case.
        plant: ``physics`` or ``kinematic``.
        preset: how good the simulated robot is.
        seed: which robot of that preset.
        tracker: whether the tip is tracked.
        compensation: ``off``, ``gain`` or ``full``.
        seconds: how much of the path is played, s; None for all of it.
    """

    experiment: str
    case: str
    plant: str
    preset: str
    seed: int
    tracker: bool
    compensation: str
    seconds: float | None = None

    def options(self, configuration: Configuration) -> RunOptions:
        """The run's options; raises :class:`robot.errors.UnknownName`."""
        found = experiment(self.experiment, configuration)
        return options_for(
            found,
            configuration,
            self.case,
            plant=self.plant,
            preset=self.preset,
            seed=self.seed,
            tracker=self.tracker,
            compensation=self.compensation,
            path=cut(found.path, self.seconds),
        )

    def name(self, configuration: Configuration, calibration: str | None) -> str:
        """A name for files: the options, and a mark of all else that the result depends on.

        Args:
            configuration: the study's.
            calibration: JSON of the calibration that is given, or None.
        """
        applied = self.options(configuration).applied(configuration)
        whole = "\n".join([program_mark(), applied.model_dump_json(), calibration or ""])
        mark = hashlib.sha256(whole.encode()).hexdigest()[:_MARK_LENGTH]
        part = "" if self.seconds is None else f"_first-{self.seconds:g}s"
        tracked = "on" if self.tracker else "off"
        return (
            f"{self.experiment}_case-{self.case}_{self.plant}_{self.preset}_seed-{self.seed}"
            f"_tracker-{tracked}_compensation-{self.compensation}{part}_{mark}"
        )

    def words(self) -> str:
        """For people."""
        tracked = "on" if self.tracker else "off"
        return (
            f"{self.experiment}, case {self.case}, {self.preset}, seed {self.seed}, "
            f"tracker {tracked}, compensation {self.compensation}"
        )

    def weight(self, configuration: Configuration) -> float:
        """Duration of the path, s."""
        return self.options(configuration).path.duration_s

    def outcome(
        self,
        configuration: Configuration,
        calibration: Calibration | None,
        interrupted: Callable[[], bool],
    ) -> Outcome:
        """Run it.

        Args:
            configuration: the study's.
            calibration: of the robot, or None to calibrate it where it is needed.
            interrupted: asked every tick whether to stop.
        """
        options = self.options(configuration)
        run = HeadlessRun(configuration, options, calibration)
        result = run.execute(lambda _: None, interrupted)
        if result.ended == "interrupted":
            return Outcome(None)
        document = result_document(run.configuration, options, result)
        return finished(document, packed_trace(result, run.dt_s))


@dataclass(frozen=True)
class Sweep:
    """Values to combine with each other; every attribute holds those of one option.

    ``cases`` None stands for the cases that each experiment lists.
    """

    experiments: Sequence[str]
    cases: Sequence[str] | None
    plants: Sequence[str]
    presets: Sequence[str]
    seeds: Sequence[int]
    trackers: Sequence[bool]
    compensations: Sequence[str]
    seconds: float | None = None

    def tasks(self, configuration: Configuration) -> list[Task]:
        """Every combination, in a fixed order; raises :class:`robot.errors.UnknownName`."""
        tasks = []
        for name in self.experiments:
            cases = self.cases or experiment(name, configuration).cases
            combinations = itertools.product(
                cases, self.plants, self.presets, self.trackers, self.compensations, self.seeds
            )
            for case, plant, preset, tracker, compensation, seed in combinations:
                tasks.append(
                    Task(name, case, plant, preset, seed, tracker, compensation, self.seconds)
                )
        return tasks
