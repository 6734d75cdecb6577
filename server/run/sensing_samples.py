"""Many measurements of the rod at one stop, what each method makes of them, and its errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hardware.rod.pose_noise import SensorNoise, measure
from server.run.sensing_methods import Backbone, Findings, Methods
from server.run.sensing_options import MEAN_OF
from server.run.sensing_rod import Stop

EVERY = 2
"""Of the rod's places, how many there are to one at which shapes are compared."""
NORMAL_95 = 3.841458820694124
"""Square of the distance within which 95 % of a normal variable lie."""
NORMAL_95_3 = 7.814727903251178
"""Likewise of three of them."""


@dataclass(frozen=True)
class SampleSet:
    """What came of the measurements of one stop.

    Attributes:
        true: the rod's backbone.
        true_force: (3,) N.
        axis: (3,) of the contact; None in free bending.
        fractions: (n,) places along the backbone.
        position_errors: (samples, n) distances in m, by method.
        angle_errors: (samples, n) rotation angles in rad, by method.
        shown: shapes of the first measurement, by method.
        forces: (samples, 3) N, by method and what was assumed.
        covariances: (samples, 3, 3) N^2, of the joint estimates.
        nanoseconds: of each joint estimate.
    """

    true: Backbone
    true_force: np.ndarray
    axis: np.ndarray | None
    fractions: np.ndarray
    position_errors: dict[str, np.ndarray]
    angle_errors: dict[str, np.ndarray]
    shown: dict[str, Backbone]
    forces: dict[str, np.ndarray]
    covariances: dict[str, np.ndarray]
    nanoseconds: np.ndarray

    def force_along(self, name: str) -> np.ndarray:
        """(samples,) errors along the contact's axis, N; there must be one."""
        assert self.axis is not None
        return np.asarray((self.forces[name] - self.true_force) @ self.axis)

    def force_distance(self, name: str) -> np.ndarray:
        """(samples,) lengths of the errors, N."""
        return np.asarray(np.linalg.norm(self.forces[name] - self.true_force, axis=1))

    def means_along(self, name: str) -> np.ndarray:
        """Errors along the axis of the means of ``MEAN_OF`` estimates each, N."""
        errors = self.force_along(name)
        whole = len(errors) // MEAN_OF
        return np.asarray(errors[: whole * MEAN_OF].reshape(whole, MEAN_OF).mean(axis=1))

    def inside(self, name: str) -> np.ndarray:
        """(samples,) whether the true force lies in the estimate's 95 % region.

        With a known axis that is an interval along it, without one an ellipsoid.
        """
        errors, covariances = self.forces[name] - self.true_force, self.covariances[name]
        if name.endswith("axis_known"):
            assert self.axis is not None
            variances = np.einsum("i,nij,j->n", self.axis, covariances, self.axis)
            return np.asarray((errors @ self.axis) ** 2 <= NORMAL_95 * variances)
        solved = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
        return np.asarray(np.einsum("ni,ni->n", errors, solved) <= NORMAL_95_3)


def fractions_of(stop: Stop) -> np.ndarray:
    """(n,) places along the backbone at which shapes are compared."""
    return np.ascontiguousarray(stop.shape.fractions[::EVERY])


def backbone_of(stop: Stop) -> Backbone:
    """The rod's own backbone there."""
    return Backbone(stop.shape.positions[::EVERY], stop.shape.rotations[::EVERY])


def sampled(
    stop: Stop,
    sliding: np.ndarray,
    axis: np.ndarray | None,
    methods: Methods,
    noise: SensorNoise,
    count: int,
    rng: np.random.Generator,
    interrupted: Callable[[], bool] = lambda: False,
) -> SampleSet:
    """Measure ``count`` times and let every method estimate each time.

    Args:
        stop: where the rod stands.
        sliding: (4,) shares as followed by the estimator.
        axis: (3,) along which the contact pushes; None where there is none.
        methods: calibrated.
        noise: of the sensors.
        count: how many measurements; fewer where it is interrupted.
        rng: where their errors come from.
        interrupted: asked before each but the first.
    """
    found: list[Findings] = []
    for _ in range(count):
        if found and interrupted():
            break
        seen = measure(stop.shape, stop.tensions, noise, rng)
        found.append(methods.every(seen, sliding, axis))
    true = backbone_of(stop)
    names = list(found[0].shapes)
    return SampleSet(
        true,
        stop.shape.force,
        axis,
        fractions_of(stop),
        {name: np.array([_off(one.shapes[name], true) for one in found]) for name in names},
        {name: np.array([_turned(one.shapes[name], true) for one in found]) for name in names},
        found[0].shapes,
        {name: np.array([one.forces[name] for one in found]) for name in found[0].forces},
        {name: np.array([one.covariances[name] for one in found]) for name in found[0].covariances},
        np.concatenate([one.nanoseconds for one in found]),
    )


def _off(shape: Backbone, true: Backbone) -> np.ndarray:
    return np.asarray(np.linalg.norm(shape.positions - true.positions, axis=1))


def _turned(shape: Backbone, true: Backbone) -> np.ndarray:
    """(n,) angles between cross-sections, rad: matrices lie 2 sqrt(2) sin(angle / 2) apart."""
    apart = np.linalg.norm(shape.rotations - true.rotations, axis=(1, 2))
    return np.asarray(2.0 * np.arcsin(np.minimum(apart / math.sqrt(8.0), 1.0)))
