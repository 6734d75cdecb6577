"""Headless runs for the tests: each is run once, however many tests look at it."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration, Start
from robot.records import Case
from scenes.experiments import experiment
from scenes.path import Path
from scenes.static_optimum import StaticOptimum
from server.configuration_file import load
from server.run.figures import result_document
from server.run.headless import TRACE_COLUMNS, HeadlessRun, RunResult
from server.run.options import RunOptions
from tests import own_kinematics


class Run(NamedTuple):
    """What came of it: raw, and as the JSON document."""

    result: RunResult
    document: dict[str, Any]

    def largest(self, what: str) -> float:
        """Largest error, ``position_mm``, ``orientation_deg`` or ``rcm_mm``."""
        return float(self.document["errors"][what]["max"])

    def final(self, what: str) -> float:
        """Last error."""
        return float(self.document["errors"][what]["final"])

    @property
    def joints(self) -> np.ndarray:
        """(steps, 7) true joint angles, rad."""
        return self.result.trace[:, 1:8]

    @property
    def uv(self) -> np.ndarray:
        """(steps, 2) true segment coordinates, rad."""
        phi, delta = 0.5 * math.pi - self.result.trace[:, 8], self.result.trace[:, 9]
        return np.column_stack([phi * np.cos(delta), phi * np.sin(delta)])

    def column(self, name: str) -> np.ndarray:
        """(steps,) one column of the trace."""
        return np.asarray(self.result.trace[:, TRACE_COLUMNS.index(name)])


@functools.cache
def configuration() -> Configuration:
    """The one that comes along."""
    return load()


def changed(section: str, **values: object) -> Configuration:
    """The configuration with other values in one section."""
    one = getattr(configuration(), section)
    other = type(one).model_validate({**one.model_dump(), **values})
    return configuration().model_copy(update={section: other})


def straight_start() -> Configuration:
    """The configuration that starts with a straight segment."""
    assert isinstance(configuration().start, Start)
    return changed("start", bend_deg=0.0)


def play(
    path: Path,
    case: str = "1",
    solver: str = "hqp",
    coordinates: str = "uv",
    under: Configuration | None = None,
) -> Run:
    """Run a path."""
    chosen = under or configuration()
    options = RunOptions(path.name, path, case, solver, coordinates, plant="kinematic")
    run = HeadlessRun(chosen, options)
    result = run.execute(lambda _: None, lambda: False)
    return Run(result, result_document(run.configuration, options, result))


@functools.cache
def named(name: str, case: str = "1", solver: str = "hqp", coordinates: str = "uv") -> Run:
    """Run an experiment, once."""
    return play(experiment(name, configuration()).path, case, solver, coordinates)


def path(rows: list[list[float]], name: str) -> Path:
    """A path of rows time_s, x_m, y_m, z_m and, if it turns, a rotation vector in rad."""
    samples = np.zeros((len(rows), 8))
    for sample, row in zip(samples, rows, strict=True):
        sample[:4] = row[:4]
        turn = Rotation.from_rotvec(row[4:7] if len(row) > 4 else [0.0, 0.0, 0.0])
        sample[4:] = turn.as_quat()[[3, 0, 1, 2]]
    return Path(samples, name)


class Recomputed(NamedTuple):
    """Errors (steps,) recomputed from a trace: m, rad, m."""

    position: np.ndarray
    orientation: np.ndarray
    rcm: np.ndarray


def recompute(trace: np.ndarray, under: Configuration) -> Recomputed:
    """Errors from the joints, theta and delta of a trace, by other kinematics than the program's.

    Args:
        trace: (steps, 28) rows as ``--trace`` writes them.
        under: the configuration of the run.
    """
    errors = np.empty((len(trace), 3))
    for row, error in zip(trace, errors, strict=True):
        where = own_kinematics.pose(under, row[1:8], row[8], row[9])
        desired = Rotation.from_quat(row[[22, 23, 24, 21]]).as_matrix()
        error[0] = np.linalg.norm(row[18:21] - where.tip)
        error[1] = own_kinematics.angle_between(desired, where.rotation)
        error[2] = own_kinematics.distance_from_axis(row[25:28], where.shaft_base, where.shaft_end)
    return Recomputed(errors[:, 0], errors[:, 1], errors[:, 2])


def optimum(run: Run, case: Case, every: int) -> np.ndarray:
    """(n, 3): index of the instant, best position error (m) and orientation error (rad) there."""
    solver = StaticOptimum(configuration(), case)
    found = []
    for index in range(0, len(run.result.trace), every):
        row = run.result.trace[index]
        rotation = Rotation.from_quat(row[[22, 23, 24, 21]]).as_matrix()
        found.append([index, *solver.solve(row[18:21], rotation)])
    return np.array(found)
