"""What the report runs, and how its parts find what came of it."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from server.study.folder import StudyFolder
from server.study.study import StudyResult
from server.study.task import Task


class Setting(NamedTuple):
    """One experiment as it is run with every seed.

    Attributes:
        experiment: its name.
        case: name of the priority case.
        tracker: whether the tip is tracked.
        compensation: ``off``, ``gain`` or ``full``.
    """

    experiment: str
    case: str
    tracker: bool = False
    compensation: str = "full"

    def words(self) -> str:
        """As on the command line."""
        tracked = "on" if self.tracker else "off"
        return (
            f"{self.experiment} --case {self.case} --tracker {tracked} "
            f"--compensation {self.compensation}"
        )


SETTINGS: tuple[Setting, ...] = (
    *(Setting("arc", "0", False, mode) for mode in ("off", "gain", "full")),
    Setting("arc-stylus", "0"),
    *(Setting("circle", case) for case in "012"),
    Setting("circle", "0", True),
    Setting("circle-yz", "0", True),
    Setting("square", "0"),
    *(Setting("circle-infeasible", case) for case in "012"),
    *(Setting(f"silicon-{shape}", case, True) for shape in ("sine", "arc") for case in "12"),
    *(Setting("ring-board", case, True) for case in "012"),
)
"""All that the report shows."""


def tasks(plant: str, preset: str, seeds: Sequence[int], seconds: float | None) -> list[Task]:
    """The report's runs.

    Args:
        plant: name of the plant.
        preset: name of the preset.
        seeds: every setting is run with each.
        seconds: how much of each path is played; None for all of it.
    """
    return [
        Task(one.experiment, one.case, plant, preset, seed, one.tracker, one.compensation, seconds)
        for one in SETTINGS
        for seed in seeds
    ]


class Results:
    """Finished runs by setting.

    Args:
        study: what the study has come to.
        folder: where its files are.
    """

    def __init__(self, study: StudyResult[Task], folder: StudyFolder) -> None:
        self._study, self._folder = study, folder

    def _of(self, setting: Setting) -> list[Task]:
        return [
            task
            for task in self._study.documents
            if Setting(task.experiment, task.case, task.tracker, task.compensation) == setting
        ]

    def documents(self, setting: Setting) -> list[dict[str, Any]]:
        """The figures of every seed, by seed."""
        found = sorted(self._of(setting), key=lambda task: task.seed)
        return [self._study.documents[task] for task in found]

    def traces(self, setting: Setting) -> list[dict[str, np.ndarray]]:
        """The traces of every seed, by seed; see :meth:`StudyFolder.traces`."""
        found = sorted(self._of(setting), key=lambda task: task.seed)
        return [self._trace(self._study.names[task]) for task in found]

    @functools.cache  # noqa: B019 - lives as long as the report is made
    def _trace(self, name: str) -> dict[str, np.ndarray]:
        return self._folder.traces(name)
