"""Figures of several runs that the claims are decided from: residuals, dexterity, accuracy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.configuration import Configuration
from robot.dexterity import Dexterity
from robot.priority.levels import case_named
from server.report.results import Results, Setting
from server.run.figure_table import figure

_EVERY_ROWS = 10
"""Of the traces' rows, 20 ms apart: dexterity changes slowly."""


@dataclass(frozen=True)
class DexterityRow:
    """Means over a path, all seeds: inverse condition number and manipulability.

    Attributes:
        inverse_linear: 1/kappa of J_L.
        inverse_angular: 1/kappa of J_A.
        linear: manipulability of J_L.
        angular: manipulability of J_A.
    """

    inverse_linear: float
    inverse_angular: float
    linear: float
    angular: float


@dataclass(frozen=True)
class Table5:
    """Raw and projected measures by case."""

    raw: dict[str, DexterityRow]
    projected: dict[str, DexterityRow]


PAPER_TABLE_5 = {
    "0": DexterityRow(0.60, 0.58, 0.632, 0.621),
    "1": DexterityRow(0.71, 0.62, 0.698, 0.625),
    "2": DexterityRow(0.61, 0.68, 0.635, 0.682),
}
"""As printed."""


def table_5(results: Results, configuration: Configuration) -> Table5 | None:
    """Dexterity along the ring board's path under each case; None if one of them is missing."""
    dexterity = Dexterity(configuration)
    raw: dict[str, DexterityRow] = {}
    projected: dict[str, DexterityRow] = {}
    for case in "012":
        runs = results.traces(Setting("ring-board", case, True))
        if not runs:
            return None
        rows: dict[str, list[list[float]]] = {"raw": [], "projected": []}
        for run in runs:
            for row in run["trace"][::_EVERY_ROWS]:
                found = dexterity.at(_configuration_of(row), case_named(case))
                for kind, values in rows.items():
                    one, other = found[kind]["linear"], found[kind]["angular"]
                    values.append(
                        [
                            one["inverse_condition"],
                            other["inverse_condition"],
                            one["manipulability"],
                            other["manipulability"],
                        ]
                    )
        raw[case] = DexterityRow(*np.mean(rows["raw"], axis=0).tolist())
        projected[case] = DexterityRow(*np.mean(rows["projected"], axis=0).tolist())
    return Table5(raw, projected)


def _configuration_of(row: np.ndarray) -> np.ndarray:
    """The true configuration (10,) of a trace's row."""
    phi, delta = 0.5 * math.pi - row[8], row[9]
    return np.array([*row[1:8], phi * math.cos(delta), phi * math.sin(delta), row[10]])


def residuals(results: Results, experiment: str) -> dict[str, tuple[float, float]] | None:
    """By case: rms of the linear (mm/s) and the angular (deg/s) residual, median over the seeds."""
    found = {}
    for case in "012":
        runs = results.traces(Setting(experiment, case))
        if not runs:
            return None
        rms = np.array([np.sqrt(np.mean(run["detail"][:, 1:3] ** 2, axis=0)) for run in runs])
        linear, angular = np.median(rms, axis=0) * [1e3, 180.0 / math.pi]
        found[case] = (float(linear), float(angular))
    return found


def accuracy(results: Results, setting: Setting, kind: str) -> tuple[float, float] | None:
    """Position (mm) and orientation error (deg) of a setting, median over the seeds.

    Args:
        results: the finished runs.
        setting: which.
        kind: ``max`` or ``rms``.
    """
    documents = results.documents(setting)
    if not documents:
        return None
    position, orientation = (
        float(np.median([figure(one, f"errors.{what}.{kind}") or 0.0 for one in documents]))
        for what in ("position_mm", "orientation_deg")
    )
    return position, orientation


def lambda_error(results: Results, experiment: str) -> dict[str, float] | None:
    """By case: the largest distance of lambda from its reference, median over the seeds."""
    found = {}
    for case in "012":
        documents = results.documents(Setting(experiment, case))
        if not documents:
            return None
        found[case] = float(np.median([one["lambda"]["max_abs_error"] for one in documents]))
    return found
