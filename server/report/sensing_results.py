"""Finished runs of shape and force sensing, and how the report's parts find them."""

from __future__ import annotations

from typing import Any

import numpy as np

from scenes.experiments.sensing import COVERAGE
from server.report.sensing_tasks import SEEDS, SensingWork
from server.run.sensing_figures import coverage_document
from server.run.sensing_options import TENSION_NOISE_N
from server.run.sensing_traces import coverage_of
from server.study.folder import StudyFolder
from server.study.study import StudyResult


class SensingResults:
    """Finished runs by experiment, noise and friction.

    Attributes:
        study: what the study has come to.
        seconds: how long the runs of this report took.
        whole: whether there are as many samples, trials and seeds as targets want.

    Args:
        study: as above.
        folder: where its files are.
        seconds: as above.
    """

    def __init__(
        self, study: StudyResult[SensingWork], folder: StudyFolder, seconds: float = 0.0
    ) -> None:
        self.study, self._folder, self.seconds = study, folder, seconds
        self.whole = {task.seed for task in study.names} >= set(SEEDS)

    def _of(
        self,
        experiment: str,
        noise: tuple[float, float] | None = None,
        friction: float | None = None,
        tension: float = TENSION_NOISE_N,
    ) -> list[SensingWork]:
        found = [
            task
            for task in self.study.documents
            if task.experiment == experiment
            and noise in (None, task.noise)
            and friction in (None, task.friction)
            and task.tension == tension
        ]
        return sorted(found, key=lambda task: task.seed)

    def documents(
        self,
        experiment: str,
        noise: tuple[float, float] | None = None,
        friction: float | None = None,
        tension: float = TENSION_NOISE_N,
    ) -> list[dict[str, Any]]:
        """The figures of every seed, by seed; None stands for any noise or friction."""
        tasks = self._of(experiment, noise, friction, tension)
        return [self.study.documents[task] for task in tasks]

    def arrays(
        self,
        experiment: str,
        noise: tuple[float, float] | None = None,
        friction: float | None = None,
    ) -> dict[str, np.ndarray] | None:
        """The arrays of the first seed; None if it is not finished."""
        for task in self._of(experiment, noise, friction):
            return self._folder.traces(self.study.names[task])
        return None

    def coverage(self) -> dict[str, Any] | None:
        """All finished trials in one document; None if there is none."""
        tasks = self._of(COVERAGE)
        if not tasks:
            return None
        parts = [self._folder.traces(self.study.names[task]) for task in tasks]
        return coverage_document(tasks[0].options(), coverage_of(parts))
