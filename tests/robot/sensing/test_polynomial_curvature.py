"""Polynomial curvature in one plane: the pose, every Jacobian, and what paper 3 prints of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from robot import segment
from robot.sensing.polynomial_curvature import (
    HILBERT,
    bend_at,
    curvature_at,
    elastic_energy,
    energy_gradient,
    make_canonical,
    position_jacobian,
    rotation_jacobian,
    shape_frames,
    tendon_jacobian,
    tendon_lengths,
    tip_jacobian,
    tip_pose,
)
from tests.robot.differences import twist_columns

LENGTH, PITCH_RADIUS, STIFFNESS = 0.030, 0.0018, 1.841e-4


def random_shapes(rng: np.random.Generator, count: int) -> np.ndarray:
    """Bends up to 90 deg either way, directions that are not multiples of 90 deg."""
    theta = rng.uniform(-0.5 * math.pi, 0.5 * math.pi, count)
    m1, m2 = rng.normal(0.0, 1.0, (2, count))
    delta = rng.integers(0, 4, count) * 0.5 * math.pi + rng.uniform(0.1, 1.4, count)
    return np.column_stack([theta - m1 / 2 - m2 / 3, m1, m2, delta])


def pose(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position, rotation = np.empty(3), np.empty((3, 3))
    tip_pose(shape, LENGTH, position, rotation)
    return position, rotation


def jacobian(shape: np.ndarray) -> np.ndarray:
    out = np.empty((6, 4))
    tip_jacobian(shape, LENGTH, out)
    return out


def gradient(shape: np.ndarray) -> np.ndarray:
    out = np.empty(4)
    energy_gradient(shape, STIFFNESS, LENGTH, out)
    return out


def pulled(shape: np.ndarray) -> np.ndarray:
    out = np.empty(4)
    tendon_lengths(shape, PITCH_RADIUS, out)
    return out


def in_units_of_length(twists: np.ndarray) -> np.ndarray:
    return np.asarray(twists / np.array([LENGTH] * 3 + [1.0] * 3)[:, None])


def printed_37(shape: np.ndarray) -> np.ndarray:
    """J_omegaS as paper 3 prints it in (37)."""
    theta, delta = bend_at(shape, 1.0), shape[3]
    st, ct, sd, cd = math.sin(theta), math.cos(theta), math.sin(delta), math.cos(delta)
    rows = np.outer([-ct * sd, ct * cd, -st], [1.0, 1 / 2, 1 / 3])
    return np.column_stack([rows, [st * cd, st * sd, ct - 1.0]])


def printed_42(shape: np.ndarray) -> np.ndarray:
    """dU/dS as paper 3 prints it in (42)."""
    table = np.array([[1, 1 / 4, 1 / 3], [1 / 4, 1 / 3, 1 / 8], [1 / 3, 1 / 8, 1 / 5]])
    return np.asarray(np.append(LENGTH * STIFFNESS * table @ shape[:3], 0.0))


def test_positions_are_integrals_to_twelve_digits(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 30):
        aside = quad(lambda s, m: math.sin(bend_at(m, s)), 0, 1, shape, epsabs=1e-14)[0]
        ahead = quad(lambda s, m: math.cos(bend_at(m, s)), 0, 1, shape, epsabs=1e-14)[0]
        expected = [aside * math.cos(shape[3]), -aside * math.sin(shape[3]), ahead]
        np.testing.assert_allclose(pose(shape)[0] / LENGTH, expected, rtol=0, atol=1e-12)


def test_rotation_is_the_paper_s_three_turns(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 30):
        angles = [-shape[3], bend_at(shape, 1.0), shape[3]]
        expected = Rotation.from_euler("ZYZ", angles).as_matrix()
        np.testing.assert_allclose(pose(shape)[1], expected, rtol=0, atol=1e-14)


def test_frames_along_follow_the_curvature(rng: np.random.Generator) -> None:
    step = 1e-5
    for shape in random_shapes(rng, 30):
        s = rng.uniform(0.1, 0.9)
        positions, rotations = shape_frames(shape, LENGTH, np.array([s - step, s, s + step, 1.0]))
        tangent = (positions[2] - positions[0]) / (2 * step * LENGTH)
        np.testing.assert_allclose(tangent, rotations[1][:, 2], rtol=0, atol=1e-8)
        turn = Rotation.from_matrix(rotations[2] @ rotations[0].T).as_rotvec() / (2 * step)
        plane = np.array([math.sin(shape[3]), math.cos(shape[3]), 0.0])
        np.testing.assert_allclose(turn, curvature_at(shape, s) * plane, rtol=0, atol=1e-7)
        np.testing.assert_array_equal(positions[3], pose(shape)[0])


def test_without_m1_and_m2_it_is_the_arc(rng: np.random.Generator) -> None:
    position, rotation = np.empty(3), np.empty((3, 3))
    for shape in random_shapes(rng, 30):
        shape[0], shape[1], shape[2] = bend_at(shape, 1.0), 0.0, 0.0
        u, v = shape[0] * math.cos(shape[3]), shape[0] * math.sin(shape[3])
        segment.tip_position(u, v, LENGTH, position)
        segment.tip_rotation(u, v, rotation)
        np.testing.assert_allclose(pose(shape)[0], position, rtol=0, atol=1e-16)
        np.testing.assert_allclose(pose(shape)[1], rotation, rtol=0, atol=1e-14)


def test_tip_jacobian_is_the_derivative(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 200):
        found, expected = jacobian(shape), twist_columns(pose, shape)
        np.testing.assert_allclose(
            in_units_of_length(found), in_units_of_length(expected), rtol=0, atol=1e-7
        )
        upper, lower = np.empty((3, 4)), np.empty((3, 4))
        position_jacobian(shape, LENGTH, upper)
        rotation_jacobian(shape, lower)
        np.testing.assert_array_equal(found, np.vstack([upper, lower]))


def test_tendon_jacobian_and_energy_gradient_are_derivatives(rng: np.random.Generator) -> None:
    step, columns = 1e-5, np.empty((4, 4))
    for shape in random_shapes(rng, 200):
        tendon_jacobian(shape, PITCH_RADIUS, columns)
        slope = gradient(shape)
        for k in range(4):
            change = step * np.eye(4)[k]
            rate = (pulled(shape + change) - pulled(shape - change)) / (2 * step)
            np.testing.assert_allclose(columns[:, k], rate, rtol=0, atol=1e-7 * PITCH_RADIUS)
            after = elastic_energy(shape + change, STIFFNESS, LENGTH)
            before = elastic_energy(shape - change, STIFFNESS, LENGTH)
            assert slope[k] == pytest.approx((after - before) / (2 * step), rel=1e-7, abs=1e-10)


def test_energy_is_that_of_the_curvature_per_metre(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 20):
        per_metre = quad(lambda s, m: (curvature_at(m, s) / LENGTH) ** 2, 0, 1, shape)[0]
        expected = 0.5 * STIFFNESS * LENGTH * per_metre
        assert elastic_energy(shape, STIFFNESS, LENGTH) == pytest.approx(expected, rel=1e-12)


def test_tendon_lengths_are_the_arc_s_where_the_bend_is_the_same(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 20):
        theta, delta = bend_at(shape, 1.0), shape[3]
        u, v = theta * math.cos(delta), theta * math.sin(delta)
        np.testing.assert_allclose(
            pulled(shape), PITCH_RADIUS * np.array([-u, v, u, -v]), rtol=0, atol=1e-17
        )


def test_what_is_printed_is_no_derivative(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 20):
        expected = twist_columns(pose, shape)
        assert np.abs(printed_37(shape) - expected[3:]).max() > 0.1
        along = np.linspace(0.0, 1.0, 2001)
        bends = np.array([bend_at(shape, s) for s in along])
        turn = Rotation.from_euler("Z", -shape[3]).as_matrix()
        cosine, sine = np.trapezoid(np.cos(bends), along), np.trapezoid(np.sin(bends), along)
        printed_35 = LENGTH * turn @ [cosine, -sine, 0.0]
        corrected = LENGTH * turn @ [0.0, -sine, 0.0]
        np.testing.assert_allclose(corrected, expected[:3, 3], rtol=0, atol=1e-5 * LENGTH)
        assert np.abs(printed_35 - expected[:3, 3]).max() > 0.1 * LENGTH
        largest = np.abs(gradient(shape)).max()
        assert np.abs(printed_42(shape) - gradient(shape)).max() > 0.5 * largest


def test_the_printed_coefficients_of_42_are_not_even_those_of_40() -> None:
    shape = np.array([1.0, 0.5, -0.2, 0.3])
    with_the_printed_length = LENGTH**2 * gradient(shape)
    ratio = printed_42(shape)[:3] / with_the_printed_length[:3]
    assert np.abs(ratio - 1.0).max() > 0.1
    np.testing.assert_allclose(HILBERT, 1.0 / (np.add.outer(range(3), range(3)) + 1.0), rtol=1e-15)


def test_two_states_are_the_same_shape_and_one_is_kept(rng: np.random.Generator) -> None:
    for shape in random_shapes(rng, 50):
        other = np.append(-shape[:3], shape[3] + math.pi)
        for found, expected in zip(pose(other), pose(shape), strict=True):
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
        make_canonical(shape)
        make_canonical(other)
        assert bend_at(shape, 1.0) >= 0.0
        assert -math.pi < shape[3] <= math.pi
        np.testing.assert_allclose(other, shape, rtol=0, atol=1e-14)


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 1e-6])
def test_straight_is_finite_and_only_delta_does_nothing(size: float) -> None:
    shape = size * np.array([1.0, -0.3, 0.2, 0.0]) + np.array([0.0, 0.0, 0.0, 0.7])
    found = jacobian(shape)
    assert np.isfinite(found).all()
    assert np.isfinite(gradient(shape)).all()
    assert np.abs(found[:, 3]).max() <= size
    make_canonical(shape)
    assert shape[3] == pytest.approx(0.7)
    np.testing.assert_allclose(pose(shape)[1], np.eye(3), rtol=0, atol=2 * size)


def test_a_pose_sees_the_four_states_as_unequally_as_expected() -> None:
    bent = np.array([0.25 * math.pi, 0.0, 0.0, 0.4])
    scaled = in_units_of_length(jacobian(bent))
    np.testing.assert_allclose(np.linalg.svd(scaled)[1], [1.276, 0.851, 0.0917, 0.00151], rtol=2e-3)
    weak = np.linalg.svd(scaled)[2][3][:3]
    expected = np.array([1 / 6, -1.0, 1.0]) / np.linalg.norm([1 / 6, -1.0, 1.0])
    assert abs(weak @ expected) > 0.99
    straight = in_units_of_length(jacobian(np.array([0.0, 0.0, 0.0, 0.4])))
    assert np.linalg.matrix_rank(straight, tol=1e-9) == 2
