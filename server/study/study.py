"""A study: tasks that are not yet done are given to workers, and what is finished is kept."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from robot.configuration import Configuration
from server.commands.progress_bar import ProgressBar, clock
from server.run.figure_table import csv_text
from server.study.cluster_workers import cluster_outcomes
from server.study.folder import StudyFolder
from server.study.local_workers import local_outcomes
from server.study.program_mark import program_mark
from server.study.work import Outcome, StudyTask, Work

TABLE = "table.csv"
AnyTask = TypeVar("AnyTask", bound=StudyTask)


@dataclass
class StudyResult(Generic[AnyTask]):
    """What a study has come to.

    Attributes:
        names: file name of every task, in the tasks' order.
        documents: figures of the finished ones, by task.
        failures: why there are none, by task.
        stopped: whether it was stopped before its end.
    """

    names: dict[AnyTask, str]
    documents: dict[AnyTask, dict[str, Any]] = field(default_factory=dict)
    failures: dict[AnyTask, str] = field(default_factory=dict)
    stopped: bool = False

    def in_order(self) -> list[dict[str, Any]]:
        """The documents in the order of the tasks."""
        return [self.documents[task] for task in self.names if task in self.documents]


@dataclass(frozen=True)
class Study(Generic[AnyTask]):
    """What to run, under what, and where the results go.

    Attributes:
        tasks: what to run.
        configuration: what the tasks leave open.
        calibration: JSON of a calibration for all, or None: each robot is calibrated first.
        folder: where the results go.
        jobs: processes on this machine.
        scheduler: address of a Dask scheduler, or None for this machine.
        table: writes the figures of all runs as one CSV.
    """

    tasks: Sequence[AnyTask]
    configuration: Configuration
    calibration: str | None
    folder: StudyFolder
    jobs: int
    scheduler: str | None = None
    table: Callable[[Iterable[dict[str, Any]]], str] = csv_text

    def run(self, stopped: Callable[[], bool]) -> StudyResult[AnyTask]:
        """Do what is not yet done, and write the table.

        Args:
            stopped: asked now and then; once it says yes, the study ends in order.
        """
        names = {task: task.name(self.configuration, self.calibration) for task in self.tasks}
        result: StudyResult[AnyTask] = StudyResult(names)
        for task, name in names.items():
            document = self.folder.document(name)
            if document is not None:
                result.documents[task] = document
        left = [task for task in names if task not in result.documents]
        if left:
            self._do(left, result, stopped)
        result.stopped = stopped()
        self.folder.write(TABLE, self.table(result.in_order()).encode())
        return result

    def _do(
        self, left: list[AnyTask], result: StudyResult[AnyTask], stopped: Callable[[], bool]
    ) -> None:
        text = self.configuration.model_dump_json()
        works = [
            Work(task, result.names[task], text, self.calibration, program_mark()) for task in left
        ]
        named = {result.names[task]: task for task in left}
        weights = {result.names[task]: task.weight(self.configuration) for task in left}
        progress = _Progress(weights, len(result.names) - len(left))
        for work, outcome in self._outcomes(works, stopped):
            if outcome.document is not None:
                self.folder.keep(work.name, outcome)
                result.documents[named[work.name]] = outcome.document
            elif outcome.failure:
                result.failures[named[work.name]] = outcome.failure
            progress.done(work, outcome)
        progress.end()

    def _outcomes(
        self, works: Sequence[Work], stopped: Callable[[], bool]
    ) -> Iterator[tuple[Work, Outcome]]:
        if self.scheduler is not None:
            return cluster_outcomes(works, self.scheduler, stopped)
        return local_outcomes(works, self.jobs, stopped)


class _Progress:
    """A bar where somebody looks, a line a run elsewhere; the longer a path, the more it counts."""

    def __init__(self, weights: dict[str, float], before: int) -> None:
        self._weights = weights
        self._total = sum(weights.values())
        self._share = 0.0
        self._count, self._all = before, before + len(weights)
        self._bar = ProgressBar(f"{before} of {self._all} runs") if sys.stderr.isatty() else None
        self._started = time.monotonic()
        if self._bar is not None:
            self._bar(0.0)
        elif before:
            print(f"{before} of {self._all} runs were finished before", file=sys.stderr)

    def done(self, work: Work, outcome: Outcome) -> None:
        """Take in that ``work`` is over."""
        task = work.task
        self._count += 1
        self._share += self._weights[work.name] / self._total
        if self._bar is not None:
            self._bar.title = f"{self._count} of {self._all} runs, last {task.experiment}"
            self._bar(self._share)
            return
        left = (time.monotonic() - self._started) * (1.0 - self._share) / self._share
        ended = outcome.failure or (outcome.document or {"ended": "given up"})["ended"]
        line = f"{self._count}/{self._all} {task.words()}: {ended}, {clock(max(0.0, left))} left"
        print(line, file=sys.stderr, flush=True)

    def end(self) -> None:
        """Leave the bar's line."""
        if self._bar is not None:
            self._bar.end()
