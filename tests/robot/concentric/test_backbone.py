"""The shape that is drawn ends where the kinematics end."""

from __future__ import annotations

import numpy as np
import pytest

from robot.concentric.backbone import backbone, tube_extents
from tests.robot.concentric.arm_solution import (
    FOUR_TUBES,
    configuration,
    overlapping_configuration,
    solve_stable,
)

THREE = FOUR_TUBES[:3]


def shape(
    q: np.ndarray, tubes: np.ndarray, arc: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    torsion = solve_stable(q, tubes).torsion
    positions, rotations = np.empty((len(arc), 3)), np.empty((len(arc), 3, 3))
    backbone(q, torsion, tubes, arc, positions, rotations)
    return positions, rotations, torsion


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_it_begins_at_the_exit_and_ends_at_the_tip(count: int, rng: np.random.Generator) -> None:
    tubes = FOUR_TUBES[:count]
    for _ in range(10):
        q = overlapping_configuration(tubes, rng, 0.01 if count > 1 else 0.0)
        tip = tube_extents(q, tubes)[0, 2]
        solution = solve_stable(q, tubes)
        positions, rotations, _ = shape(q, tubes, np.linspace(0.0, tip, 30))
        np.testing.assert_allclose(positions[0], 0.0, atol=0)
        np.testing.assert_allclose(rotations[0][:, 2], [0, 0, 1], atol=0)
        np.testing.assert_allclose(positions[-1], solution.position, rtol=0, atol=1e-12)
        np.testing.assert_allclose(rotations[-1], solution.rotation, rtol=0, atol=1e-11)


def test_its_points_are_where_their_tangents_lead(rng: np.random.Generator) -> None:
    q = overlapping_configuration(THREE, rng, 0.03)
    tip = tube_extents(q, THREE)[0, 2]
    arc = np.linspace(0.0, tip, 20001)
    positions, rotations, _ = shape(q, THREE, arc)
    tangents = rotations[:, :, 2]
    middle = 0.5 * (tangents[1:] + tangents[:-1])
    led = np.cumsum(middle * np.diff(arc)[:, None], axis=0)
    np.testing.assert_allclose(positions[1:], led, rtol=0, atol=1e-9)


def test_coarse_and_fine_sampling_agree(rng: np.random.Generator) -> None:
    q = overlapping_configuration(THREE, rng, 0.03)
    tip = tube_extents(q, THREE)[0, 2]
    coarse, _, _ = shape(q, THREE, np.linspace(0.0, tip, 5))
    fine, _, _ = shape(q, THREE, np.linspace(0.0, tip, 401))
    np.testing.assert_allclose(coarse, fine[::100], rtol=0, atol=1e-12)


def test_places_outside_the_arm_are_its_ends() -> None:
    q = configuration([-250, -200, -120], [10, 70, -40])
    positions, _, _ = shape(q, THREE, np.array([-0.05, 0.0, 0.187, 0.3]))
    np.testing.assert_array_equal(positions[0], positions[1])
    np.testing.assert_allclose(positions[2], positions[3], rtol=0, atol=1e-15)


def test_where_each_tube_is() -> None:
    extents = tube_extents(configuration([-250, -200, -199], [0, 0, 0]), THREE) * 1e3
    np.testing.assert_allclose(
        extents, [[-250, 137, 187], [-200, 67, 117], [-199, 0, 0]], rtol=0, atol=1e-10
    )
