"""The shape that gives a pose of the tip: found cold, the right one of several, or refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.errors import InvalidPose
from robot.sensing.polynomial_curvature import (
    HILBERT,
    bend_at,
    elastic_energy,
    shape_frames,
    tip_jacobian,
    tip_pose,
)
from robot.sensing.shape_from_pose import ImpossiblePose, PoseDeviations, shape_from_pose
from tests.robot.sensing.planar_equilibrium import Loads, at_rest, bending_tensions

LENGTH = 0.030
EXACT = PoseDeviations(1e-8, 1e-6)
"""Of a pose without noise: the prior hardly counts."""
ALONG = np.linspace(0.0, 1.0, 21)


def pose(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position, rotation = np.empty(3), np.empty((3, 3))
    tip_pose(shape, LENGTH, position, rotation)
    return position, rotation


def noisy(
    shape: np.ndarray, deviations: PoseDeviations, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    position, rotation = pose(shape)
    turn = Rotation.from_rotvec(rng.normal(0.0, deviations.rotation, 3)).as_matrix()
    return position + rng.normal(0.0, deviations.position, 3), turn @ rotation


def random_shapes(rng: np.random.Generator, count: int, least_deg: float = 0.0) -> np.ndarray:
    theta = np.radians(rng.uniform(least_deg, 90.0, count))
    m1, m2 = rng.normal(0.0, 0.5, (2, count))
    delta = rng.uniform(-math.pi, math.pi, count)
    return np.column_stack([theta - m1 / 2 - m2 / 3, m1, m2, delta])


def shape_error(found: np.ndarray, true: np.ndarray) -> float:
    """Mean along the segment, m."""
    off = shape_frames(found, LENGTH, ALONG)[0] - shape_frames(true, LENGTH, ALONG)[0]
    return float(np.linalg.norm(off, axis=1).mean())


def test_every_random_pose_is_found_cold_in_ten_iterations(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 100):
        found = shape_from_pose(*pose(shape), LENGTH)
        assert found.converged
        assert found.iterations <= 10
        # What the prior takes of m1 and m2, in the directions that the tip hardly shows.
        assert shape_error(found.shape, shape) < 0.3e-3
        assert np.linalg.norm(found.residual[:3]) < 0.25e-3
        assert np.linalg.norm(found.residual[3:]) < math.radians(0.5)


def test_without_noise_it_is_the_shape_itself(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 100, least_deg=10.0):
        found = shape_from_pose(*pose(shape), LENGTH, EXACT)
        assert found.converged
        assert found.iterations <= 10
        np.testing.assert_allclose(found.shape, shape, rtol=0, atol=1e-4)


def test_shapes_in_contact_are_found(rng: np.random.Generator) -> None:
    for _ in range(10):
        bend, delta = math.radians(rng.uniform(40, 80)), rng.uniform(-math.pi, math.pi)
        force = 0.2 * np.append(-np.array([math.cos(delta), -math.sin(delta)]), 0.2)
        shape = at_rest(Loads(bending_tensions(bend, delta), force))
        found = shape_from_pose(*pose(shape), LENGTH, EXACT)
        assert found.iterations <= 10
        np.testing.assert_allclose(found.shape, shape, rtol=0, atol=1e-4)


def test_an_arc_comes_out_as_the_arc(rng: np.random.Generator) -> None:
    for theta in np.radians([0.1, 5.0, 45.0, 90.0, 150.0]):
        shape = np.array([theta, 0.0, 0.0, rng.uniform(-math.pi, math.pi)])
        found = shape_from_pose(*pose(shape), LENGTH)
        assert shape_error(found.shape, shape) < 1e-12


def test_the_second_exact_solution_is_not_chosen(rng: np.random.Generator) -> None:
    arc = np.array([0.25 * math.pi, 0.0, 0.0, 0.4])
    # From the arc along its weak direction, with Newton's steps onto the pose in the plane.
    other = arc + 33.0 * np.array([1 / 6, -1.0, 1.0, 0.0])
    columns = np.empty((6, 4))
    plane = np.array([math.cos(0.4), -math.sin(0.4)])
    for _ in range(20):
        tip_jacobian(other, LENGTH, columns)
        off = (pose(arc)[0] - pose(other)[0]) / LENGTH
        rows = np.vstack([plane @ columns[:2, :3] / LENGTH, columns[2, :3] / LENGTH, HILBERT[0]])
        bend = bend_at(arc, 1.0) - bend_at(other, 1.0)
        other[:3] += np.linalg.solve(rows, [plane @ off[:2], off[2], bend])
    for same, expected in zip(pose(other), pose(arc), strict=True):
        np.testing.assert_allclose(same, expected, rtol=0, atol=1e-12)
    ratio = elastic_energy(other, 1.0, LENGTH) / elastic_energy(arc, 1.0, LENGTH)
    assert ratio == pytest.approx(10.8, abs=0.05)
    np.testing.assert_allclose(shape_from_pose(*pose(other), LENGTH).shape, arc, atol=1e-9)
    np.testing.assert_allclose(shape_from_pose(*pose(other), LENGTH, EXACT).shape, arc, atol=1e-6)


def test_the_energy_takes_noise_out_of_m1_and_m2(rng: np.random.Generator) -> None:
    deviations = PoseDeviations()
    shape = np.array([0.515, 0.689, -0.223, 0.4])
    errors = {0.3: [0.0], 1e3: [0.0]}
    for _ in range(200):
        measured = noisy(shape, deviations, rng)
        for modes, found in errors.items():
            fit = shape_from_pose(*measured, LENGTH, deviations._replace(modes=modes))
            found.append(shape_error(fit.shape, shape))
    assert np.mean(errors[0.3]) < 0.15e-3
    assert np.mean(errors[1e3]) > 2.0 * np.mean(errors[0.3])


def test_noise_about_straight_settles_too(rng: np.random.Generator) -> None:
    deviations = PoseDeviations()
    for _ in range(300):
        measured = noisy(np.zeros(4), deviations, rng)
        found = shape_from_pose(*measured, LENGTH, deviations)
        assert found.converged
        assert found.iterations <= 10
        assert bend_at(found.shape, 1.0) >= 0.0
        assert shape_error(found.shape, np.zeros(4)) < 1e-3


def test_exactly_straight_is_straight() -> None:
    found = shape_from_pose(np.array([0.0, 0.0, LENGTH]), np.eye(3), LENGTH)
    np.testing.assert_array_equal(found.shape[:3], 0.0)
    assert found.converged


def test_it_is_a_minimum_of_what_is_asked(rng: np.random.Generator) -> None:
    """Stationary in every direction, also where noise leaves a residual."""
    deviations = PoseDeviations()
    scale = np.repeat([deviations.position, deviations.rotation], 3)

    def squares(shape: np.ndarray, measured: tuple[np.ndarray, np.ndarray]) -> float:
        position, rotation = pose(shape)
        turn = Rotation.from_matrix(measured[1] @ rotation.T).as_rotvec()
        off = np.append(measured[0] - position, turn) / scale
        return float(off @ off + shape[1:3] @ shape[1:3] / deviations.modes**2)

    for shape in random_shapes(rng, 20, least_deg=5.0):
        measured = noisy(shape, deviations, rng)
        found = shape_from_pose(*measured, LENGTH, deviations).shape
        for change in 1e-3 * np.eye(4):
            least = squares(found, measured)
            assert squares(found + change, measured) > least - 1e-9
            assert squares(found - change, measured) > least - 1e-9


IMPOSSIBLE = {
    "farther away than the segment is long": ([0.0, 0.0, 1.1 * LENGTH], [0.0, 0.0, 0.0]),
    "turned about its own axis": ([0.0, 0.0, LENGTH], [0.0, 0.0, 0.7]),
    "leaning to the other side": ([0.65 * LENGTH, 0.0, 0.75 * LENGTH], [0.0, -0.9, 0.0]),
    "at its own base": ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    "leaning out of the plane": ([0.4 * LENGTH, 0.0, 0.9 * LENGTH], [0.8, 0.0, 0.0]),
}


@pytest.mark.parametrize("what", IMPOSSIBLE)
def test_a_pose_that_no_bend_can_give_is_refused_by_name(what: str) -> None:
    position, turn = IMPOSSIBLE[what]
    rotation = Rotation.from_rotvec(turn).as_matrix()
    with pytest.raises(ImpossiblePose, match="no bend of the segment gives") as refusal:
        shape_from_pose(np.array(position), rotation, LENGTH)
    assert refusal.value.code == "impossible_pose"
    assert refusal.value.position_error_m >= 0.0
    assert refusal.value.rotation_error_rad >= 0.0


def test_what_is_no_pose_is_refused() -> None:
    position = np.array([0.0, 0.0, LENGTH])
    with pytest.raises(InvalidPose, match="not finite"):
        shape_from_pose(np.array([0.0, math.nan, LENGTH]), np.eye(3), LENGTH)
    with pytest.raises(InvalidPose, match="no rotation"):
        shape_from_pose(position, np.diag([1.0, 1.0, -1.0]), LENGTH)
    with pytest.raises(InvalidPose, match="no rotation"):
        shape_from_pose(position, 1.01 * np.eye(3), LENGTH)
