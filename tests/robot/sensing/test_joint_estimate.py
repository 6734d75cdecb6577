"""The joint estimate: derivatives, the independent rod, its own uncertainty, bad input."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hardware.rod.pose_noise import SensorNoise, measure
from hardware.rod.properties import RodProperties
from hardware.rod.rod import Rod, RodShape
from robot.sensing.curvature_modes import MODES, shape_of_modes
from robot.sensing.joint_estimate import (
    ESTIMATE,
    FORCE,
    MODEL,
    SAMPLE,
    TENSION,
    UNKNOWNS,
    estimate,
    force_weight,
    residuals,
)

PROPERTIES = RodProperties()
NOISE = SensorNoise(0.1, 0.25, 0.005, 0.01)
NOISE_FREE = SensorNoise()
ROWS = 23 + MODES


def model(noise: SensorNoise, **more: float) -> np.ndarray:
    """The rod as it is, and the noise as it is."""
    record = np.zeros(1, MODEL)
    values = {
        "length": PROPERTIES.length_m,
        "pitch_radius": PROPERTIES.pitch_radius_m,
        "bending_stiffness": PROPERTIES.bending_stiffness_n_m2,
        "torsion_stiffness": PROPERTIES.torsion_stiffness_n_m2,
        "friction": PROPERTIES.friction,
        "stiffness_deviation": 1e-4,
        "friction_deviation": 1e-3,
        "position_deviation": max(noise.position_mm, 0.01) * 1e-3,
        "angle_deviation": math.radians(max(noise.angle_deg, 0.02)),
        "length_deviation": max(noise.length_mm, 0.001) * 1e-3,
        "tension_deviation": max(noise.tension_n, 0.001),
        "sliding_deviation": 0.02,
        "balance_deviation": 1e-7 if noise == NOISE_FREE else 2e-6,
    }
    for name, value in (values | more).items():
        record[name] = value
    return record


def tensions_for(bend_deg: float, direction_deg: float) -> np.ndarray:
    """Tensions (4,) that bend the free segment so."""
    per_rad = PROPERTIES.bending_stiffness_n_m2 / (PROPERTIES.length_m * PROPERTIES.pitch_radius_m)
    angles = math.radians(direction_deg) + 0.5 * math.pi * np.arange(4)
    return np.asarray(0.3 + np.maximum(np.cos(angles), 0.0) * math.radians(bend_deg) * per_rad)


def loaded(bend_deg: float, direction_deg: float, force: np.ndarray) -> tuple[RodShape, np.ndarray]:
    """The rod pulled, then loaded; and its tensions."""
    rod, tensions = Rod(PROPERTIES), tensions_for(bend_deg, direction_deg)
    for share in np.linspace(0.1, 1.0, 10):
        rod.step(0.3 + share * (tensions - 0.3))
    for share in np.linspace(0.2, 1.0, 5):
        shape = rod.step(tensions, share * force)
    return shape, tensions


def sample_of(
    shape: RodShape, tensions: np.ndarray, noise: SensorNoise, rng: np.random.Generator
) -> np.ndarray:
    seen, sample = measure(shape, tensions, noise, rng), np.zeros(1, SAMPLE)
    sample["position"], sample["rotation"] = seen.position, seen.rotation
    sample["lengths"], sample["tensions"] = seen.lengths, seen.tensions
    sample["sliding"] = shape.sliding
    sample["force_weight"] = force_weight(None, 0.5, 0.5)
    return sample


def estimated(sample: np.ndarray, of: np.ndarray) -> Any:
    found = np.zeros(1, ESTIMATE)
    estimate(sample, of, found)
    return found[0]


def shape_error_mm(found: Any, shape: RodShape) -> float:
    """Mean distance along the segment."""
    places, _ = shape_of_modes(found["unknowns"][:MODES], PROPERTIES.length_m, shape.fractions)
    return float(np.linalg.norm(places - shape.positions, axis=1).mean() * 1e3)


def test_every_derivative_is_the_finite_difference(rng: np.random.Generator) -> None:
    spread = np.array([0.6, 0.2, 0.1, 0.05, 0.6, 0.2, 0.1, 0.05, 0.2, 0.1, 0.05])
    of = model(NOISE, chord=2.6e-5, contact_offset=2.3e-3, coulomb=0.1)
    unit = np.array([1e-4 / 0.03] * 3 + [math.radians(0.25)] * 3 + [1e-5 / 0.03] * 4)
    unit = np.concatenate([unit, [2e-6 / 6e-3] * MODES, np.full(13, 1e-4)])
    sample, step = np.zeros(1, SAMPLE), 1e-5
    sample["force_weight"] = force_weight(np.array([0.3, 0.5, 0.8]), 0.5, 0.05)
    place, turn = np.empty(3), np.empty((3, 3))
    ahead, behind = np.empty(ROWS), np.empty(ROWS)
    rows, ignored = np.empty((ROWS, UNKNOWNS)), np.empty((ROWS, UNKNOWNS))
    for _ in range(30):
        y = np.concatenate([
            spread * rng.normal(size=MODES), 0.3 * rng.normal(size=3), rng.uniform(0.3, 4.0, 4),
            0.1 * rng.normal(size=1), 1.0 + 0.1 * rng.normal(size=1), rng.uniform(-1.0, 1.0, 4),
        ])  # fmt: skip
        # The rows of the rotation hold where it fits.
        sample["rotation"] = np.eye(3)
        residuals(y, sample, of, place, turn, ahead, rows)
        sample["rotation"] = turn
        residuals(y, sample, of, place, turn, ahead, rows)
        for a in range(UNKNOWNS):
            d = step * np.eye(UNKNOWNS)[a]
            residuals(y + d, sample, of, place, turn, ahead, ignored)
            residuals(y - d, sample, of, place, turn, behind, ignored)
            slope = (ahead - behind) / (2.0 * step)
            assert rows[:, a] * unit == pytest.approx(slope * unit, abs=1e-7)


@pytest.mark.parametrize(
    ("bend_deg", "direction_deg", "force"),
    [
        (48.0, 135.0, (-0.1, 0.1, 0.0)),
        (48.0, 135.0, (0.12, 0.05, -0.03)),
        (30.0, 37.0, (0.0, 0.0, -0.15)),
        (67.0, -45.0, (0.05, -0.1, 0.02)),
    ],
)
def test_the_force_on_the_independent_rod_is_found(
    bend_deg: float, direction_deg: float, force: tuple[float, float, float],
    rng: np.random.Generator,
) -> None:  # fmt: skip
    """With friction and torsion, without noise: to 1 %, sign included."""
    shape, tensions = loaded(bend_deg, direction_deg, np.array(force))
    found = estimated(sample_of(shape, tensions, NOISE_FREE, rng), model(NOISE_FREE))
    assert found["settled"] == 1
    off = found["unknowns"][FORCE:TENSION] - force
    assert np.linalg.norm(off) < 0.01 * np.linalg.norm(force)
    assert shape_error_mm(found, shape) < 0.002


def test_a_free_segment_feels_nothing(rng: np.random.Generator) -> None:
    shape, tensions = loaded(45.0, 135.0, np.zeros(3))
    found = estimated(sample_of(shape, tensions, NOISE_FREE, rng), model(NOISE_FREE))
    assert found["unknowns"][FORCE:TENSION] == pytest.approx(np.zeros(3), abs=1e-3)


def test_an_axis_that_is_known_takes_the_uncertainty_away(rng: np.random.Generator) -> None:
    force = np.array([-0.1, 0.1, 0.0])
    axis = force / np.linalg.norm(force)
    shape, tensions = loaded(48.0, 135.0, force)
    sample, of = sample_of(shape, tensions, NOISE, rng), model(NOISE)
    free = estimated(sample, of)
    sample["force_weight"] = force_weight(axis, 0.5, 0.002)
    known = estimated(sample, of)
    along = slice(FORCE, TENSION)
    spread = [float(axis @ one["covariance"][along, along] @ axis) ** 0.5 for one in (free, known)]
    assert spread[1] < 0.3 * spread[0]
    assert known["unknowns"][along] @ axis == pytest.approx(np.linalg.norm(force), rel=0.05)
    assert shape_error_mm(known, shape) < 0.1


def test_the_covariance_is_the_spread_of_the_estimates(rng: np.random.Generator) -> None:
    """Of the force, in the directions in which it is known best and worst."""
    force = np.array([-0.1, 0.1, 0.0])
    shape, tensions = loaded(48.0, 135.0, force)
    of = model(NOISE, sliding_deviation=1e-4)
    along, forces = slice(FORCE, TENSION), []
    for _ in range(300):
        found = estimated(sample_of(shape, tensions, NOISE, rng), of)
        forces.append(found["unknowns"][along])
    values, vectors = np.linalg.eigh(found["covariance"][along, along])
    spread = np.std(np.array(forces) @ vectors, axis=0)
    assert spread[1:] == pytest.approx(np.sqrt(values[1:]), rel=0.25)
    # What was known of the force beforehand takes part, and holds the weakest direction together.
    assert spread[2] < 0.2


def test_what_is_not_a_number_does_not_settle(rng: np.random.Generator) -> None:
    shape, tensions = loaded(48.0, 135.0, np.zeros(3))
    for field in ("position", "rotation", "lengths", "tensions"):
        sample = sample_of(shape, tensions, NOISE, rng)
        sample[field] = np.nan
        assert estimated(sample, model(NOISE))["settled"] == 0


def test_a_pose_that_no_bend_can_give_shows_in_the_misfit(rng: np.random.Generator) -> None:
    shape, tensions = loaded(48.0, 135.0, np.zeros(3))
    sample = sample_of(shape, tensions, NOISE, rng)
    fitting = estimated(sample, model(NOISE))
    sample["position"] += [0.004, 0.0, 0.004]
    found = estimated(sample, model(NOISE))
    assert fitting["pose_misfit"] + fitting["length_misfit"] < 30.0
    assert found["settled"] == 0 or found["pose_misfit"] + found["length_misfit"] > 200.0
