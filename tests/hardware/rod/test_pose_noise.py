"""The rod as its sensors see it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hardware.rod.pose_noise import SensorNoise, measure
from hardware.rod.properties import RodProperties
from hardware.rod.rod import RodShape, solve_rod

TENSIONS = np.array([2.0, 0.8, 0.3, 0.3])


@pytest.fixture(scope="module")
def shape() -> RodShape:
    return solve_rod(RodProperties(), TENSIONS, np.zeros(4), np.array([0.05, 0.02, 0.0]))


def test_without_noise_the_truth_is_measured(shape: RodShape, rng: np.random.Generator) -> None:
    seen = measure(shape, TENSIONS, SensorNoise(), rng)
    np.testing.assert_array_equal(seen.position, shape.tip_position)
    np.testing.assert_array_equal(seen.rotation, shape.tip_rotation)
    np.testing.assert_array_equal(seen.tensions, TENSIONS)
    np.testing.assert_array_equal(seen.lengths, shape.lengths)


def test_errors_are_as_large_as_said_and_independent(
    shape: RodShape, rng: np.random.Generator
) -> None:
    noise = SensorNoise(position_mm=0.25, angle_deg=0.5, tension_n=0.02, length_mm=0.03)
    errors = []
    for _ in range(4000):
        seen = measure(shape, TENSIONS, noise, rng)
        turn = Rotation.from_matrix(seen.rotation @ shape.tip_rotation.T).as_rotvec(degrees=True)
        moved = 1e3 * (seen.position - shape.tip_position)
        lengths = 1e3 * (seen.lengths - shape.lengths)
        errors.append(np.concatenate([moved, turn, seen.tensions - TENSIONS, lengths]))
    deviations = [0.25] * 3 + [0.5] * 3 + [0.02] * 4 + [0.03] * 4
    np.testing.assert_allclose(np.std(errors, axis=0), deviations, rtol=0.06)
    scaled = np.mean(errors, axis=0) / deviations
    np.testing.assert_allclose(scaled, 0.0, atol=0.08)
    correlations = np.corrcoef(np.array(errors).T) - np.eye(14)
    assert np.abs(correlations).max() < 0.08


def test_a_measured_orientation_is_a_rotation(shape: RodShape, rng: np.random.Generator) -> None:
    seen = measure(shape, TENSIONS, SensorNoise(angle_deg=20.0), rng)
    np.testing.assert_allclose(seen.rotation @ seen.rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(seen.rotation) == pytest.approx(1.0)


def test_noise_of_one_kind_leaves_the_draws_of_the_others(shape: RodShape) -> None:
    few = measure(shape, TENSIONS, SensorNoise(tension_n=0.1), np.random.default_rng(5))
    every = measure(shape, TENSIONS, SensorNoise(1.0, 1.0, 0.1, 1.0), np.random.default_rng(5))
    np.testing.assert_array_equal(few.tensions, every.tensions)
