"""Shape and force from one sample, beside scipy on the same problem and beside paper 3's way.

All run in the same process, turn by turn, on the same measurements of the simulated rod, pressed by
the five levels of ``force-levels``. Ours is the joint estimate, cold from its own start. scipy's
``least_squares`` gets the same residuals with the same derivatives from the same start. Paper 3's
way is the shape from the pose, then the force from the shape; it solves less, and says less.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from benchmarks.percentiles import percentiles
from hardware.rod.pose_noise import Measurement
from hardware.rod.pose_noise import measure as measure_once
from robot.configuration import Configuration
from robot.sensing.joint_estimate import (
    ESTIMATE,
    FORCE,
    SAMPLE,
    TENSION,
    UNKNOWNS,
    estimate,
    residuals,
)
from robot.sensing.shape_from_pose import fit_shape
from robot.sensing.virtual_work import fill_balance, wrench_of_balance
from server.run.sensing_calibration import Calibrated, calibrate
from server.run.sensing_methods import EstimateNotSettled, along
from server.run.sensing_options import SensingOptions
from server.run.sensing_rod import drawn_properties, pressed, swept

_ROWS = 34
_WARM_UP = 50
_START_LEVEL = UNKNOWNS - 5
_MODES_DEVIATION = 0.3


def _samples(count: int) -> tuple[Calibrated, list[Measurement], np.ndarray]:
    """A calibrated rod, measurements of it in contact, and the contact's normal (3,)."""
    options = SensingOptions("force-levels")
    rng = np.random.default_rng(options.seed)
    properties = drawn_properties(options.friction, rng)
    calibrated = calibrate(swept(properties), options.noise, rng)
    levels = pressed(properties)
    several = len(levels.levels)
    # Not in step with the turns of scipy, which would else see one level only.
    chosen = (levels.levels[(index + index // several) % several] for index in range(count))
    seen = [measure_once(one.shape, one.tensions, options.noise, rng) for one in chosen]
    return calibrated, seen, levels.normal


def _sample(seen: Measurement, sliding: np.ndarray, weight: np.ndarray) -> np.ndarray:
    sample = np.zeros(1, SAMPLE)
    sample["position"], sample["rotation"] = seen.position, seen.rotation
    sample["lengths"], sample["tensions"] = seen.lengths, seen.tensions
    sample["sliding"], sample["force_weight"] = sliding, weight
    return sample


class ScipyEstimate:
    """The same least-squares problem for scipy.

    Args:
        model: (1,) ``MODEL``.
    """

    def __init__(self, model: np.ndarray) -> None:
        self._model = model
        self._position, self._rotation = np.empty(3), np.empty((3, 3))
        self._residual, self._rows = np.empty(_ROWS), np.empty((_ROWS, UNKNOWNS))

    def solve(self, sample: np.ndarray) -> np.ndarray:
        """(24,) unknowns for a (1,) ``SAMPLE``."""

        def evaluate(y: np.ndarray) -> None:
            residuals(
                y, sample, self._model, self._position, self._rotation, self._residual, self._rows
            )

        def left(y: np.ndarray) -> np.ndarray:
            evaluate(y)
            return self._residual.copy()

        def slope(y: np.ndarray) -> np.ndarray:
            evaluate(y)
            return self._rows.copy()

        found = least_squares(left, self._start(sample), slope, method="lm", x_scale="jac")
        return np.asarray(found.x)

    def _start(self, sample: np.ndarray) -> np.ndarray:
        """Where ours starts: constant curvature after the tendons."""
        d, radius = sample[0], float(self._model["pitch_radius"][0])
        y = np.zeros(UNKNOWNS)
        y[0] = 0.5 * (d["lengths"][1] - d["lengths"][3]) / radius
        y[4] = 0.5 * (d["lengths"][2] - d["lengths"][0]) / radius
        y[FORCE:TENSION] = d["force"]
        y[TENSION : TENSION + 4] = d["tensions"]
        y[_START_LEVEL] = 1.0
        y[UNKNOWNS - 4 :] = d["sliding"]
        return y


class PaperEstimate:
    """Paper 3's way: the shape from the pose, then the force along the axis.

    Args:
        calibrated: stiffness and friction.
        axis: (3,) of the contact.
    """

    def __init__(self, calibrated: Calibrated, axis: np.ndarray) -> None:
        model, fit = calibrated.model[0], calibrated.fit
        self._segment = (float(model["length"]), float(model["pitch_radius"]), fit.stiffness)
        self._friction = (fit.friction, fit.coulomb)
        position, angle = float(model["position_deviation"]), float(model["angle_deviation"])
        self._deviations = (position, angle, _MODES_DEVIATION)
        self._unknowns = np.zeros((6, 1))
        self._unknowns[:3, 0] = axis
        self._shape, self._residual = np.empty(4), np.empty(6)
        self._jacobian, self._missing = np.empty((6, 4)), np.empty(4)
        self._wrench, self._rest, self._gains = np.empty(6), np.empty(4), np.empty(1)

    def solve(self, sample: np.ndarray) -> np.ndarray:
        """(3,) force for a (1,) ``SAMPLE``."""
        d = sample[0]
        fit_shape(
            d["position"], d["rotation"], self._segment[0], self._deviations, self._shape,
            self._residual,
        )  # fmt: skip
        fill_balance(
            self._shape, self._segment, d["tensions"], d["sliding"], self._friction,
            self._jacobian, self._missing,
        )  # fmt: skip
        wrench_of_balance(
            self._jacobian, self._missing, self._unknowns, np.zeros(1), self._wrench, self._rest,
            self._gains,
        )  # fmt: skip
        return self._wrench[:3]


def _alternate(count: int, turns: int) -> dict[str, Any]:
    """Figures of ``count`` estimates, with ``turns`` of scipy's spread among them."""
    calibrated, seen, normal = _samples(count + _WARM_UP)
    sliding, weight = np.array([-1.0, -1.0, 1.0, 1.0]), along(normal)
    found = np.zeros(1, ESTIMATE)
    peer, paper = ScipyEstimate(calibrated.model), PaperEstimate(calibrated, normal)
    between = max(count // turns, 1)
    times: dict[str, list[int]] = {"estimate_us": [], "scipy_us": [], "paper_us": []}
    steps, apart = 0, 0.0
    for index, one in enumerate(seen):
        sample = _sample(one, sliding, weight)
        began = time.perf_counter_ns()
        estimate(sample, calibrated.model, found)
        ended = time.perf_counter_ns()
        if not found["settled"][0]:
            raise EstimateNotSettled(int(found["steps"][0]))
        paper.solve(sample)
        paper_ended = time.perf_counter_ns()
        if index < _WARM_UP:
            peer.solve(sample)
            continue
        times["estimate_us"].append(ended - began)
        times["paper_us"].append(paper_ended - ended)
        steps = max(steps, int(found["steps"][0]))
        if (index - _WARM_UP) % between == 0:
            began = time.perf_counter_ns()
            other = peer.solve(sample)
            times["scipy_us"].append(time.perf_counter_ns() - began)
            off = other[FORCE:TENSION] - found["unknowns"][0, FORCE:TENSION]
            apart = max(apart, float(np.abs(off).max()))
    document: dict[str, Any] = {name: percentiles(values) for name, values in times.items()}
    for name, key in (("scipy", "ratio_scipy"), ("paper", "ratio_paper")):
        for share in ("p50", "p99"):
            quotient = document["estimate_us"][share] / document[f"{name}_us"][share]
            document[f"{key}_{share}"] = quotient
    return {**document, "steps_max": steps, "forces_apart_mn": 1e3 * apart}


def measure(configuration: Configuration, seconds: float) -> dict[str, Any]:
    """Measure.

    Args:
        configuration: its rate stands beside the estimate.
        seconds: about how long it takes.

    Returns:
        ``estimate_us``, ``scipy_us`` and ``paper_us`` with p50 and p99; ``ratio_scipy_p50`` and the
        others: ours over theirs; ``share_of_period_p99`` of the control loop; ``steps_max`` of the
        search; ``forces_apart_mn``: largest difference from scipy's forces; ``estimates`` of ours,
        ``turns`` of scipy.
    """
    count = min(max(round(seconds * 1000.0), 200), 10000)
    turns = min(max(round(seconds * 50.0), 10), 500)
    document = _alternate(count, turns)
    period_us = 1e6 / configuration.control.rate_hz
    share = document["estimate_us"]["p99"] / period_us
    return {**document, "share_of_period_p99": share, "estimates": count, "turns": turns}
