"""A study: tasks that are not yet done are given to workers, and what is finished is kept."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from robot.configuration import Configuration
from server.commands.progress_bar import ProgressBar, clock
from server.run.figure_table import csv_text
from server.study.cluster_workers import cluster_outcomes
from server.study.folder import StudyFolder
from server.study.local_workers import local_outcomes
from server.study.program_mark import program_mark
from server.study.task import Task
from server.study.work import Outcome, Work

TABLE = "table.csv"


@dataclass
class StudyResult:
    """What a study has come to.

    Attributes:
        names: file name of every task, in the tasks' order.
        documents: figures of the finished ones, by task.
        failures: why there are none, by task.
        stopped: whether it was stopped before its end.
    """

    names: dict[Task, str]
    documents: dict[Task, dict[str, Any]] = field(default_factory=dict)
    failures: dict[Task, str] = field(default_factory=dict)
    stopped: bool = False

    def in_order(self) -> list[dict[str, Any]]:
        """The documents in the order of the tasks."""
        return [self.documents[task] for task in self.names if task in self.documents]


@dataclass(frozen=True)
class Study:
    """What to run, under what, and where the results go.

    Attributes:
        tasks: what to run.
        configuration: what the tasks leave open.
        calibration: JSON of a calibration for all, or None: each robot is calibrated first.
        folder: where the results go.
        jobs: processes on this machine.
        scheduler: address of a Dask scheduler, or None for this machine.
    """

    tasks: Sequence[Task]
    configuration: Configuration
    calibration: str | None
    folder: StudyFolder
    jobs: int
    scheduler: str | None = None

    def run(self, stopped: Callable[[], bool]) -> StudyResult:
        """Do what is not yet done, and write the table.

        Args:
            stopped: asked now and then; once it says yes, the study ends in order.
        """
        names = {task: task.name(self.configuration, self.calibration) for task in self.tasks}
        result = StudyResult(names)
        for task, name in names.items():
            document = self.folder.document(name)
            if document is not None:
                result.documents[task] = document
        left = [task for task in names if task not in result.documents]
        if left:
            self._do(left, result, stopped)
        result.stopped = stopped()
        self.folder.write(TABLE, csv_text(result.in_order()).encode())
        return result

    def _do(self, left: list[Task], result: StudyResult, stopped: Callable[[], bool]) -> None:
        text = self.configuration.model_dump_json()
        works = [
            Work(task, result.names[task], text, self.calibration, program_mark()) for task in left
        ]
        progress = _Progress(left, self.configuration, len(result.names) - len(left))
        for work, outcome in self._outcomes(works, stopped):
            if outcome.document is not None:
                self.folder.keep(work.name, outcome)
                result.documents[work.task] = outcome.document
            elif outcome.failure:
                result.failures[work.task] = outcome.failure
            progress.done(work.task, outcome)
        progress.end()

    def _outcomes(
        self, works: Sequence[Work], stopped: Callable[[], bool]
    ) -> Iterator[tuple[Work, Outcome]]:
        if self.scheduler is not None:
            return cluster_outcomes(works, self.scheduler, stopped)
        return local_outcomes(works, self.jobs, stopped)


class _Progress:
    """A bar where somebody looks, a line a run elsewhere; the longer a path, the more it counts."""

    def __init__(self, tasks: Sequence[Task], configuration: Configuration, before: int) -> None:
        self._weights = {task: task.options(configuration).path.duration_s for task in tasks}
        self._total = sum(self._weights.values())
        self._share = 0.0
        self._count, self._all = before, before + len(tasks)
        self._bar = ProgressBar(f"{before} of {self._all} runs") if sys.stderr.isatty() else None
        self._started = time.monotonic()
        if self._bar is not None:
            self._bar(0.0)
        elif before:
            print(f"{before} of {self._all} runs were finished before", file=sys.stderr)

    def done(self, task: Task, outcome: Outcome) -> None:
        """Take in that ``task`` is over."""
        self._count += 1
        self._share += self._weights[task] / self._total
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
