"""The arc as the counterpart of polynomial curvature: exact for arcs, and only for them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot import segment
from robot.errors import InvalidPose
from robot.sensing.constant_curvature import arc_balance, arc_from_pose
from robot.sensing.polynomial_curvature import shape_frames, tip_pose
from robot.sensing.shape_from_pose import shape_from_pose
from robot.sensing.virtual_work import (
    SegmentModel,
    TendonLoad,
    balance,
    force_along,
    force_without_moment,
    wrench_with_prior,
)
from tests.robot.sensing.planar_equilibrium import (
    LENGTH,
    PITCH_RADIUS,
    STIFFNESS,
    Loads,
    at_rest,
    bending_tensions,
)

SEGMENT = SegmentModel(LENGTH, PITCH_RADIUS, STIFFNESS)
ALONG = np.linspace(0.0, 1.0, 21)


def arc_pose(bend: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position, rotation = np.empty(3), np.empty((3, 3))
    segment.tip_position(bend[0], bend[1], LENGTH, position)
    segment.tip_rotation(bend[0], bend[1], rotation)
    return position, rotation


def random_bend(rng: np.random.Generator, largest: float = 1.6) -> np.ndarray:
    phi, delta = rng.uniform(0.0, largest), rng.uniform(-math.pi, math.pi)
    return phi * np.array([math.cos(delta), math.sin(delta)])


def state_of(bend: np.ndarray) -> np.ndarray:
    """S of an arc."""
    return np.array([math.hypot(*bend), 0.0, 0.0, math.atan2(bend[1], bend[0])])


def test_an_arc_leaves_neither_model_an_error(rng: np.random.Generator) -> None:
    for bend in [np.zeros(2), *(random_bend(rng, 2.5) for _ in range(50))]:
        true = segment.shape_frames(bend[0], bend[1], LENGTH, ALONG)[0]
        arc = arc_from_pose(*arc_pose(bend), LENGTH)
        assert arc.converged
        found = segment.shape_frames(arc.bend[0], arc.bend[1], LENGTH, ALONG)[0]
        np.testing.assert_allclose(found, true, rtol=0, atol=1e-14)
        polynomial = shape_from_pose(*arc_pose(bend), LENGTH).shape
        found = shape_frames(polynomial, LENGTH, ALONG)[0]
        np.testing.assert_allclose(found, true, rtol=0, atol=1e-13)


def test_the_arc_is_the_nearest_one_to_a_noisy_pose(rng: np.random.Generator) -> None:
    deviations = (0.25e-3, math.radians(0.5))
    scale = np.repeat(deviations, 3)
    for _ in range(50):
        position, rotation = arc_pose(random_bend(rng))
        position = position + rng.normal(0.0, deviations[0], 3)
        rotation = Rotation.from_rotvec(rng.normal(0.0, deviations[1], 3)).as_matrix() @ rotation
        found = arc_from_pose(position, rotation, LENGTH, deviations)
        assert found.converged

        def squares(bend: np.ndarray, seen: np.ndarray, turned: np.ndarray) -> float:
            there, turn = arc_pose(bend)
            off = np.append(seen - there, Rotation.from_matrix(turned @ turn.T).as_rotvec())
            return float(np.sum((off / scale) ** 2))

        least = squares(found.bend, position, rotation)
        assert np.sum((found.residual / scale) ** 2) == pytest.approx(least)
        for change in 1e-3 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]):
            assert squares(found.bend + change, position, rotation) > least


def test_in_contact_it_is_no_arc() -> None:
    force = np.array([-0.2, 0.1, -0.1])
    shape = at_rest(Loads(bending_tensions(math.radians(60), 0.4), force))
    position, rotation = np.empty(3), np.empty((3, 3))
    tip_pose(shape, LENGTH, position, rotation)
    bend = arc_from_pose(position, rotation, LENGTH).bend
    true = shape_frames(shape, LENGTH, ALONG)[0]
    arc = segment.shape_frames(bend[0], bend[1], LENGTH, ALONG)[0]
    polynomial = shape_frames(shape_from_pose(position, rotation, LENGTH).shape, LENGTH, ALONG)[0]
    arc_error = np.linalg.norm(arc - true, axis=1).mean()
    assert arc_error > 0.3e-3
    assert np.linalg.norm(polynomial - true, axis=1).mean() < 0.2 * arc_error


def test_its_balance_is_the_one_of_s_without_m1_and_m2(rng: np.random.Generator) -> None:
    for _ in range(50):
        bend = random_bend(rng)
        load = TendonLoad(rng.uniform(0.1, 4.0, 4), rng.uniform(-1.0, 1.0, 4), 0.2, 0.05)
        arc, polynomial = arc_balance(bend, SEGMENT, load), balance(state_of(bend), SEGMENT, load)
        phi, delta = state_of(bend)[[0, 3]]
        to_polar = np.array(
            [[math.cos(delta), -phi * math.sin(delta)], [math.sin(delta), phi * math.cos(delta)]]
        )
        kept = [0, 3]
        np.testing.assert_allclose(
            arc.missing @ to_polar, polynomial.missing[kept], rtol=0, atol=1e-14
        )
        np.testing.assert_allclose(
            arc.jacobian @ to_polar, polynomial.jacobian[:, kept], rtol=0, atol=1e-14
        )


def test_free_bending_shows_no_force(rng: np.random.Generator) -> None:
    for _ in range(20):
        bend = random_bend(rng)
        tensions = bending_tensions(math.hypot(*bend), math.atan2(bend[1], bend[0]))
        given = arc_balance(bend, SEGMENT, TendonLoad(tensions))
        assert np.linalg.norm(force_without_moment(given).force) < 1e-12
        assert np.linalg.norm(wrench_with_prior(given).force) < 1e-12
        polynomial = balance(state_of(bend), SEGMENT, TendonLoad(tensions))
        assert np.linalg.norm(force_along(polynomial, np.array([1.0, 0.2, 0.3])).force) < 1e-12


def test_a_small_force_across_is_found_from_the_arc_it_makes() -> None:
    """Near straight, where an arc's tip moves with u and v alone, the two balances agree."""
    load = TendonLoad(np.full(4, 0.3))
    bend = np.array([0.02, -0.01])
    found = force_without_moment(arc_balance(bend, SEGMENT, load))
    columns = np.empty((6, 2))
    segment.jacobian(bend[0], bend[1], LENGTH, columns)
    np.testing.assert_allclose(
        columns[:3].T @ found.force, STIFFNESS / LENGTH * bend, rtol=1e-9, atol=0
    )
    # Two equations: the third component, nearly along the backbone, is taken as zero.
    assert abs(found.force[2]) < 0.05 * np.linalg.norm(found.force)
    np.testing.assert_allclose(found.unexplained, 0.0, rtol=0, atol=1e-15)


def test_the_prior_comes_back_in_what_an_arc_cannot_see() -> None:
    prior = np.array([0.1, -0.2, 0.3, 1e-3, 2e-3, -1e-3])
    given = arc_balance(np.array([0.7, 0.3]), SEGMENT, TendonLoad(np.full(4, 0.3)))
    found, without = wrench_with_prior(given, prior), wrench_with_prior(given)
    change = np.append(found.force - without.force, found.moment - without.moment)
    hidden = np.eye(6) - np.linalg.pinv(given.jacobian.T) @ given.jacobian.T
    np.testing.assert_allclose(change, hidden @ prior, rtol=0, atol=1e-12)
    assert len(found.gains) == 2


def test_what_is_no_pose_is_refused() -> None:
    with pytest.raises(InvalidPose, match="not finite"):
        arc_from_pose(np.array([math.inf, 0.0, LENGTH]), np.eye(3), LENGTH)
    with pytest.raises(InvalidPose, match="no rotation"):
        arc_from_pose(np.array([0.0, 0.0, LENGTH]), -np.eye(3), LENGTH)
