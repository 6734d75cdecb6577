"""Every way to shape and force that the sensing experiments compare, on one measurement.

- ``ours``: shape and force at once, from pose, lengths and tensions (robot.sensing.joint_estimate);
  once as the console has it, knowing nothing of the contact, once with its axis known, or, in free
  bending, that there is none;
- ``polynomial``: paper 3's way, the shape from the pose, then the force from the shape by virtual
  work, closed in three ways;
- ``constant``: the same with an arc for the shape;
- ``constant_with_lengths``: an arc from pose and tendon lengths, for a comparison of shapes on
  more equal terms.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np

from hardware.rod.pose_noise import Measurement, SensorNoise
from robot.errors import KeyholeError
from robot.segment import jacobian, tip_position, tip_rotation
from robot.sensing.constant_curvature import arc_balance, fit_arc, pose_difference
from robot.sensing.curvature_modes import MODES, shape_of_modes
from robot.sensing.joint_estimate import ESTIMATE, FORCE, SAMPLE, TENSION, estimate, force_weight
from robot.sensing.polynomial_curvature import shape_frames
from robot.sensing.shape_from_pose import PoseDeviations, shape_from_pose
from robot.sensing.virtual_work import (
    Balance,
    SegmentModel,
    TendonLoad,
    balance,
    force_along,
    force_without_moment,
    wrench_with_prior,
)
from server.run.sensing_calibration import Calibrated

FORCE_EXPECTED_N = 0.5
"""Standard deviation of the contact forces to expect; the estimate knows no more beforehand."""
ASIDE_N = 1e-3
"""Standard deviation of what a force may have beside a known axis."""
_MODES_DEVIATION = 0.3
_LEAST_M, _LEAST_RAD = 1e-5, math.radians(0.02)
_STEPS = 12


ANYWHERE = force_weight(None, FORCE_EXPECTED_N, FORCE_EXPECTED_N)
"""What is known of a force of which nothing is known, as ``SAMPLE`` wants it."""
NOWHERE = force_weight(None, ASIDE_N, ASIDE_N)
"""What is known of a force where nothing touches."""


def along(axis: np.ndarray) -> np.ndarray:
    """(3, 3) what is known of a force along a known axis (3,)."""
    return force_weight(axis, FORCE_EXPECTED_N, ASIDE_N)


class EstimateNotSettled(KeyholeError):
    """The search for shape and force did not end."""

    code = "estimate_not_settled"

    def __init__(self, steps: int) -> None:
        super().__init__(
            f"the estimate of shape and force did not settle in {steps} steps; give less --noise"
        )


class Backbone(NamedTuple):
    """Frames along the backbone.

    Attributes:
        positions: (n, 3) m.
        rotations: (n, 3, 3).
    """

    positions: np.ndarray
    rotations: np.ndarray


class JointEstimate(NamedTuple):
    """Shape and force at once.

    Attributes:
        shape: of the backbone.
        force: (3,) N.
        covariance: (3, 3) of the force, N^2.
        nanoseconds: how long it took.
    """

    shape: Backbone
    force: np.ndarray
    covariance: np.ndarray
    nanoseconds: int


class Findings(NamedTuple):
    """What every method says of one measurement.

    Attributes:
        shapes: by method.
        forces: (3,) in N, by method and what was assumed.
        covariances: (3, 3) of the forces of ``ours``, N^2.
        nanoseconds: of each joint estimate.
    """

    shapes: dict[str, Backbone]
    forces: dict[str, np.ndarray]
    covariances: dict[str, np.ndarray]
    nanoseconds: list[int]


class Methods:
    """All methods, with one calibration.

    Args:
        calibrated: of the rod; all methods have it.
        noise: of the sensors, as known.
        fractions: (n,) places along the backbone at which shapes are wanted.
    """

    def __init__(self, calibrated: Calibrated, noise: SensorNoise, fractions: np.ndarray) -> None:
        self._fractions = fractions
        self._fit, self._model = calibrated.fit, calibrated.model
        model = self._model[0]
        self._segment = SegmentModel(
            float(model["length"]), float(model["pitch_radius"]), self._fit.stiffness
        )
        self._deviations = PoseDeviations(
            max(1e-3 * noise.position_mm, _LEAST_M),
            max(math.radians(noise.angle_deg), _LEAST_RAD),
            _MODES_DEVIATION,
        )
        # What is compiled is loaded before anything is timed.
        straight = np.array([0.0, 0.0, self._segment.length])
        at_rest = Measurement(straight, np.eye(3), np.ones(4), np.zeros(4))
        self.joint(at_rest, np.zeros(4), ANYWHERE)

    def joint(self, seen: Measurement, sliding: np.ndarray, weight: np.ndarray) -> JointEstimate:
        """Shape and force at once.

        Args:
            seen: the measurement.
            sliding: (4,) shares as followed.
            weight: (3, 3) what is known of the force beforehand: ``ANYWHERE``, ``along`` an axis,
                or ``NOWHERE``.

        Raises:
            EstimateNotSettled: the search did not end.
        """
        sample, found = np.zeros(1, SAMPLE), np.zeros(1, ESTIMATE)
        sample["position"], sample["rotation"] = seen.position, seen.rotation
        sample["lengths"], sample["tensions"] = seen.lengths, seen.tensions
        sample["sliding"] = sliding
        sample["force_weight"] = weight
        began = time.perf_counter_ns()
        estimate(sample, self._model, found)
        took = time.perf_counter_ns() - began
        if not found["settled"][0]:
            raise EstimateNotSettled(int(found["steps"][0]))
        unknowns, covariance = found["unknowns"][0], found["covariance"][0]
        shape = shape_of_modes(unknowns[:MODES].copy(), self._segment.length, self._fractions)
        part = slice(FORCE, TENSION)
        return JointEstimate(
            Backbone(*shape), unknowns[part].copy(), covariance[part, part].copy(), took
        )

    def every(self, seen: Measurement, sliding: np.ndarray, axis: np.ndarray | None) -> Findings:
        """What all methods say; the ones that need an axis only where it is given.

        Raises:
            EstimateNotSettled: the joint search did not end.
            ImpossiblePose: no bend comes near the measured pose.
        """
        load = TendonLoad(seen.tensions, sliding, self._fit.friction, self._fit.coulomb)
        free = self.joint(seen, sliding, ANYWHERE)
        shapes, forces = {"ours": free.shape}, {"ours_axis_free": free.force}
        covariances, took = {"ours_axis_free": free.covariance}, [free.nanoseconds]
        known = self.joint(seen, sliding, NOWHERE if axis is None else along(axis))
        took.append(known.nanoseconds)
        if axis is None:
            shapes["ours_no_contact"] = known.shape
        else:
            shapes["ours_axis_known"], forces["ours_axis_known"] = known.shape, known.force
            covariances["ours_axis_known"] = known.covariance
        state = shape_from_pose(
            seen.position, seen.rotation, self._segment.length, self._deviations
        ).shape
        shapes["polynomial"] = self._planar(state)
        _three_ways("polynomial", balance(state, self._segment, load), axis, forces)
        bend = self._arc(seen)
        shapes["constant"] = self._planar(_state_of(bend))
        _three_ways("constant", arc_balance(bend, self._segment, load), axis, forces)
        bend = self._arc_with_lengths(seen, bend)
        shapes["constant_with_lengths"] = self._planar(_state_of(bend))
        return Findings(shapes, forces, covariances, took)

    def _planar(self, state: np.ndarray) -> Backbone:
        return Backbone(*shape_frames(state, self._segment.length, self._fractions))

    def _arc(self, seen: Measurement) -> np.ndarray:
        bend, residual = np.empty(2), np.empty(6)
        deviations = (self._deviations.position, self._deviations.rotation)
        rotation = np.ascontiguousarray(seen.rotation)
        fit_arc(seen.position, rotation, self._segment.length, deviations, bend, residual)
        return bend

    def _arc_with_lengths(self, seen: Measurement, start: np.ndarray) -> np.ndarray:
        """The arc (u, v) that fits pose and tendon lengths, each over its standard deviation."""
        length, radius = self._segment.length, self._segment.pitch_radius
        weights = np.ones(10)
        weights[:3] /= self._deviations.position
        weights[3:6] /= self._deviations.rotation
        weights[6:] /= float(self._model[0]["length_deviation"])
        per_bend = radius * np.array([[-1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, -1.0]])
        place, turn, columns = np.empty(3), np.empty((3, 3)), np.empty((6, 2))
        off, bend = np.empty(10), start.copy()
        for _ in range(_STEPS):
            tip_position(bend[0], bend[1], length, place)
            tip_rotation(bend[0], bend[1], turn)
            pose_difference(seen.position, seen.rotation, place, turn, off[:6])
            off[6:] = seen.lengths - per_bend @ bend
            jacobian(bend[0], bend[1], length, columns)
            rows = np.vstack([columns, per_bend]) * weights[:, None]
            bend = bend + np.linalg.lstsq(rows, weights * off, rcond=None)[0]
        return bend


def _state_of(bend: np.ndarray) -> np.ndarray:
    """S = (theta, 0, 0, delta) of an arc (u, v)."""
    return np.array([math.hypot(bend[0], bend[1]), 0.0, 0.0, math.atan2(bend[1], bend[0])])


def _three_ways(
    method: str, given: Balance, axis: np.ndarray | None, forces: dict[str, np.ndarray]
) -> None:
    forces[f"{method}_equation_43"] = wrench_with_prior(given).force
    forces[f"{method}_without_moment"] = force_without_moment(given).force
    if axis is not None:
        forces[f"{method}_axis_known"] = force_along(given, axis).force
