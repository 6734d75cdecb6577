"""Paths: through every sample, without corners in speed, still at both ends."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenes.path import Path


def at(path: Path, time_s: float) -> np.ndarray:
    out = np.empty(7)
    path.at(time_s, out)
    return out


def rotation(row: np.ndarray) -> Rotation:
    return Rotation.from_quat(row[[4, 5, 6, 3]])


def random_samples(rng: np.random.Generator, count: int) -> np.ndarray:
    """Uneven times, a wandering tip, turns of less than 60 degrees between samples."""
    samples = np.zeros((count, 8))
    samples[1:, 0] = np.cumsum(rng.uniform(0.05, 1.0, count - 1))
    samples[:, 1:4] = np.cumsum(rng.normal(size=(count, 3)) * 0.01, axis=0)
    turn = Rotation.identity()
    for row in samples:
        row[4:8] = turn.as_quat()[[3, 0, 1, 2]]
        axis = rng.normal(size=3)
        turn = Rotation.from_rotvec(rng.uniform(0, 1) * axis / np.linalg.norm(axis)) * turn
    return samples


@pytest.mark.parametrize("count", [2, 3, 4, 30])
def test_it_goes_through_every_sample(rng: np.random.Generator, count: int) -> None:
    samples = random_samples(rng, count)
    path = Path(samples, "wander")
    assert path.duration_s == samples[-1, 0]
    for row in samples:
        found = at(path, row[0])
        np.testing.assert_allclose(found[:3], row[1:4], rtol=0, atol=1e-14)
        expected = Rotation.from_quat(row[[5, 6, 7, 4]])
        assert (rotation(found) * expected.inv()).magnitude() < 1e-7


@pytest.mark.parametrize("count", [2, 3, 30])
def test_it_stands_still_before_the_start_and_after_the_end(
    rng: np.random.Generator, count: int
) -> None:
    path = Path(random_samples(rng, count), "wander")
    for early in (-1e9, -1.0, -1e-12):
        np.testing.assert_array_equal(at(path, early), at(path, 0.0))
    for late in (1e-12, 1.0, 1e9):
        np.testing.assert_array_equal(at(path, path.duration_s + late), at(path, path.duration_s))


def test_speed_has_no_corners(rng: np.random.Generator) -> None:
    """Left and right of every sample, position and orientation change at the same rate."""
    path = Path(random_samples(rng, 30), "wander")
    step = 1e-6
    for time_s in path.samples[1:-1, 0]:
        before, here, after = (at(path, time_s + k * step) for k in (-1, 0, 1))
        np.testing.assert_allclose(
            (after - here)[:3] / step, (here - before)[:3] / step, rtol=0, atol=1e-4
        )
        leaving = (rotation(after) * rotation(here).inv()).as_rotvec() / step
        arriving = (rotation(here) * rotation(before).inv()).as_rotvec() / step
        np.testing.assert_allclose(leaving, arriving, rtol=0, atol=1e-3)


def test_orientations_are_unit_quaternions_everywhere(rng: np.random.Generator) -> None:
    path = Path(random_samples(rng, 10), "wander")
    for time_s in np.linspace(0.0, path.duration_s, 500):
        assert np.linalg.norm(at(path, time_s)[3:]) == pytest.approx(1.0, abs=1e-14)


def test_sign_and_length_of_the_quaternions_do_not_matter(rng: np.random.Generator) -> None:
    samples = random_samples(rng, 30)
    flipped = samples.copy()
    flipped[:, 4:8] *= rng.choice([-1.0, 1.0], (30, 1)) * 10.0 ** rng.uniform(-2, 2, (30, 1))
    one, other = Path(samples, "as given"), Path(flipped, "flipped")
    for time_s in np.linspace(0.0, one.duration_s, 300):
        first, second = at(one, time_s), at(other, time_s)
        np.testing.assert_allclose(first[:3], second[:3], rtol=0, atol=1e-15)
        assert (rotation(first) * rotation(second).inv()).magnitude() < 1e-12


def test_it_turns_the_short_way_between_samples(rng: np.random.Generator) -> None:
    """A flip of the sign would otherwise send the tip around the long way."""
    samples = random_samples(rng, 30)
    samples[::2, 4:8] *= -1.0
    path = Path(samples, "flipping")
    for start, end in zip(path.samples[:-1], path.samples[1:], strict=True):
        whole = (rotation(end[1:]) * rotation(start[1:]).inv()).magnitude()
        for share in (0.25, 0.5, 0.75):
            there = rotation(at(path, start[0] + share * (end[0] - start[0])))
            assert (there * rotation(start[1:]).inv()).magnitude() < whole + 0.35


def test_where_samples_stand_still_the_path_does_not_swing() -> None:
    samples = np.zeros((9, 8))
    samples[:, 0], samples[:, 4] = np.arange(9), 1.0
    samples[4:, 1], samples[:, 2] = 0.01, 0.02
    path = Path(samples, "step")
    for time_s in np.linspace(0.0, 8.0, 801):
        found = at(path, time_s)
        assert -1e-15 <= found[0] <= 0.01 + 1e-15
        assert found[1] == pytest.approx(0.02, abs=1e-15)
        if time_s <= 3.0 or time_s >= 4.0:
            assert found[0] == pytest.approx(0.0 if time_s <= 3.0 else 0.01, abs=1e-15)


def test_samples_are_the_path_s_own(rng: np.random.Generator) -> None:
    samples = random_samples(rng, 5)
    before = samples.copy()
    path = Path(samples, "mine")
    np.testing.assert_array_equal(samples, before)
    samples[:] = 0.0
    np.testing.assert_allclose(at(path, before[2, 0])[:3], before[2, 1:4], rtol=0, atol=1e-14)
    with pytest.raises(ValueError, match="read-only"):
        path.samples[0, 0] = 1.0
