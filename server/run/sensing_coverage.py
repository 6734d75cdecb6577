"""How often the true force lies in the region that the joint estimate gives for it.

Every trial has a calibration of its own; a rod of its own has every fifth: it is pressed by the
five levels of ``force-levels``, and each level is a trial.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from hardware.rod.pose_noise import measure
from scenes.experiments.sensing import CONTACT_BEND, LEVEL_PULLS_N
from server.run.sensing_calibration import calibrate, read_stops
from server.run.sensing_methods import ANYWHERE, Methods, along
from server.run.sensing_options import SensingOptions
from server.run.sensing_rod import Levels, drawn_properties, pressed, swept
from server.run.sensing_run import Interrupted, Progress
from server.run.sensing_samples import NORMAL_95, NORMAL_95_3

DIRECTIONS = ("out of the platform", "in the bending plane", "out of the bending plane")
"""Axes in which errors are written down."""


@dataclass
class CoverageResult:
    """Errors and what the estimates said of them, a row a trial, N and N^2.

    Attributes:
        true: (n,) force out of the platform.
        known: (n, 2) error along the known axis, and its variance.
        errors: (n, 3) errors without knowing the axis, in ``DIRECTIONS``.
        covariances: (n, 3, 3) likewise.
        nanoseconds: of each estimate.
        ended: ``completed`` or ``interrupted``.
    """

    true: list[float] = field(default_factory=list)
    known: list[tuple[float, float]] = field(default_factory=list)
    errors: list[np.ndarray] = field(default_factory=list)
    covariances: list[np.ndarray] = field(default_factory=list)
    nanoseconds: list[int] = field(default_factory=list)
    ended: str = "completed"


def run_coverage(
    options: SensingOptions, progress: Progress, interrupted: Interrupted
) -> CoverageResult:
    """Do ``options.trials`` trials.

    Args:
        options: noise, friction, seed and how many.
        progress: called with the share done.
        interrupted: asked before each trial whether to stop.

    Raises:
        SweepUnusable: a sweep does not show stiffness and friction.
        BendNotReached: a rod does not get to the platform.
        EstimateNotSettled: an estimate did not settle.
    """
    result, count = CoverageResult(), len(LEVEL_PULLS_N)
    for rod in range(math.ceil(options.trials / count)):
        own = np.random.default_rng([options.seed, rod])
        properties = drawn_properties(options.friction, own)
        sweep, levels = swept(properties), pressed(properties)
        for level in range(min(count, options.trials - rod * count)):
            if interrupted():
                result.ended = "interrupted"
                return result
            rng = np.random.default_rng([options.seed, rod, level])
            calibrated = calibrate(sweep, options.noise, rng)
            methods = Methods(calibrated, options.noise, np.array([1.0]))
            _trial(levels, level, methods, options, rng, result)
            progress(len(result.true) / options.trials)
    return result


def _trial(
    levels: Levels,
    level: int,
    methods: Methods,
    options: SensingOptions,
    rng: np.random.Generator,
    result: CoverageResult,
) -> None:
    """Measure one level once and write down what comes of it."""
    stops = [*levels.way, *levels.levels[: level + 1]]
    shapes = [one.shape for one in stops]
    sliding = read_stops([one.tensions for one in stops], shapes, options.noise, rng).sliding[-1]
    stop, axes = stops[-1], _directions(levels.normal)
    seen = measure(stop.shape, stop.tensions, options.noise, rng)
    known = methods.joint(seen, sliding, along(levels.normal))
    free = methods.joint(seen, sliding, ANYWHERE)
    result.true.append(float(stop.shape.force @ levels.normal))
    error = float((known.force - stop.shape.force) @ levels.normal)
    result.known.append((error, float(levels.normal @ known.covariance @ levels.normal)))
    result.errors.append(axes @ (free.force - stop.shape.force))
    result.covariances.append(axes @ free.covariance @ axes.T)
    result.nanoseconds += [known.nanoseconds, free.nanoseconds]


def _directions(normal: np.ndarray) -> np.ndarray:
    """(3, 3) rows: the ``DIRECTIONS``."""
    delta = math.radians(CONTACT_BEND.delta_deg)
    across = np.array([math.sin(delta), math.cos(delta), 0.0])
    return np.array([normal, np.cross(across, normal), across])


def inside_axis_known(result: CoverageResult) -> np.ndarray:
    """(n,) whether the true force lies in the 95 % interval along the known axis."""
    errors, variances = np.array(result.known).T
    return np.asarray(errors**2 <= NORMAL_95 * variances)


def inside_axis_free(result: CoverageResult) -> np.ndarray:
    """(n,) whether the true force lies in the 95 % ellipsoid."""
    errors, covariances = np.array(result.errors), np.array(result.covariances)
    solved = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    return np.asarray(np.einsum("ni,ni->n", errors, solved) <= NORMAL_95_3)


def widths(result: CoverageResult) -> tuple[float, np.ndarray]:
    """How wide the regions are beside the errors' own spread; 1 is right, 2 twice as wide.

    Returns:
        Root of the mean variance over the rms error along the known axis; (3,) likewise without
        knowing the axis, in ``DIRECTIONS``.
    """
    errors, variances = np.array(result.known).T
    known = math.sqrt(float(variances.mean() / np.mean(errors**2)))
    free = np.array(result.covariances).mean(axis=0).diagonal()
    return known, np.sqrt(free / np.mean(np.array(result.errors) ** 2, axis=0))
