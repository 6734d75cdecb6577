"""Finished runs of the two concentric-tube arms, and how the report's parts find them."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from robot.concentric.design import METHODS
from server.report.tube_measures import TubeMeasures
from server.report.tube_tasks import PATHS, TubeWork
from server.run.tube_figures import gathered
from server.run.tube_run import trace_columns
from server.study.folder import StudyFolder
from server.study.study import StudyResult


class TubeResults:
    """Finished runs by experiment, method and start.

    Attributes:
        study: what the study has come to.
        measures: the model checked and timed; None if not measured.
        whole: whether the paths were played to their ends.
        seconds: how long the runs of this report took.

    Args:
        study: as above.
        folder: where its files are.
        measures: as above.
        seconds: as above.
    """

    def __init__(
        self,
        study: StudyResult[TubeWork],
        folder: StudyFolder,
        measures: TubeMeasures | None = None,
        seconds: float = 0.0,
    ) -> None:
        self.study, self._folder = study, folder
        self.measures, self.seconds = measures, seconds
        self.whole = all(task.points is None for task in study.names)

    def _of(self, experiment: str, method: str) -> list[TubeWork]:
        return [
            task
            for task in self.study.names
            if (task.experiment, task.method) == (experiment, method)
            and task in self.study.documents
        ]

    def documents(self, experiment: str, method: str) -> list[dict[str, Any]]:
        """The figures of every start, in the order of the starts."""
        return [self.study.documents[task] for task in self._of(experiment, method)]

    def all_starts(self, experiment: str, method: str) -> dict[str, Any] | None:
        """All starts in one document (see :func:`gathered`); None if one of them is missing.

        ``reached_percent`` is the share of all points that were reached.
        """
        wanted = [
            task
            for task in self.study.names
            if (task.experiment, task.method) == (experiment, method)
        ]
        found = self.documents(experiment, method)
        if not found or len(found) < len(wanted):
            return None
        document = gathered(found)
        document["reached_percent"] = 100.0 * document["converged_points"] / document["points"]
        return document

    def trace(self, experiment: str, method: str, start: str) -> TubeTrace | None:
        """Every inner iteration of a run; None if it is not finished or was kept without them."""
        for task in self._of(experiment, method):
            if task.start == start:
                rows = self._rows(self.study.names[task])
                return TubeTrace(rows) if rows.size else None
        return None

    @functools.cache  # noqa: B019 - lives as long as the report is made
    def _rows(self, name: str) -> np.ndarray:
        return self._folder.traces(name)["trace"]

    def furthest_out(self) -> tuple[str, str] | None:
        """Path and start of the run in which NSPWLN as printed leaves its bounds furthest."""
        runs = [one for path in PATHS for one in self.documents(path, METHODS[0])]
        if not runs:
            return None
        worst = max(runs, key=lambda one: float(one["bound_violation_mm"]))
        return worst["experiment"], worst["configuration"]


class TubeTrace:
    """Rows of :func:`trace_columns`, an inner iteration each."""

    def __init__(self, rows: np.ndarray) -> None:
        self._rows = rows
        self.tubes = (rows.shape[1] - 15) // 8
        self._places = {name: place for place, name in enumerate(trace_columns(self.tubes))}

    def column(self, name: str) -> np.ndarray:
        """(iterations,) the column called ``name``."""
        return np.asarray(self._rows[:, self._places[name]])

    def at_points(self) -> TubeTrace:
        """The last iteration of each point."""
        point = self.column("point")
        last = np.append(np.diff(point) > 0.0, True)
        return TubeTrace(self._rows[last])
