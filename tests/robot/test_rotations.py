"""Exponential, logarithm and quaternions, against scipy and against each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from robot.rotations import (
    angle_between,
    apply,
    exponential,
    logarithm,
    matrix_from_quaternion,
    multiply,
    multiply_transposed,
    orthonormalize,
    quaternion_from_matrix,
)
from tests.robot.drive import random_rotation, wxyz


def exp(vector: np.ndarray) -> np.ndarray:
    out = np.empty((3, 3))
    exponential(vector, out)
    return out


def log(matrix: np.ndarray) -> tuple[np.ndarray, float]:
    out = np.empty(3)
    return out, logarithm(matrix, out)


def unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def skew(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.99e-4, 1.01e-4, 1e-3, 0.3, 2.0, 3.1, 7.0])
def test_exponential_is_the_matrix_exponential(angle: float, rng: np.random.Generator) -> None:
    for _ in range(20):
        vector = angle * unit(rng)
        np.testing.assert_allclose(exp(vector), expm(skew(vector)), rtol=0, atol=3e-14)


@pytest.mark.parametrize("angle", [1e-12, 1e-8, 1e-4, 0.3, 2.0, 3.1, math.pi - 1e-6])
def test_logarithm_undoes_the_exponential(angle: float, rng: np.random.Generator) -> None:
    for _ in range(50):
        vector = angle * unit(rng)
        back, size = log(exp(vector))
        np.testing.assert_allclose(back, vector, rtol=0, atol=1e-15 + 4e-15 * angle)
        assert size == pytest.approx(angle, rel=1e-12, abs=1e-15)


def test_logarithm_of_no_rotation_is_zero() -> None:
    vector, angle = log(np.eye(3))
    assert angle == 0.0
    assert not vector.any()


def test_logarithm_holds_at_half_a_turn(rng: np.random.Generator) -> None:
    """There the printed form divides by sin(pi) = 0."""
    axes = [np.eye(3)[i] for i in range(3)] + [unit(rng) for _ in range(50)]
    for axis in axes:
        half_turn = 2.0 * np.outer(axis, axis) - np.eye(3)
        vector, angle = log(half_turn)
        assert angle == pytest.approx(math.pi, abs=1e-7)
        assert np.linalg.norm(vector) == pytest.approx(angle, abs=1e-12)
        np.testing.assert_allclose(exp(vector), half_turn, rtol=0, atol=3e-8)
        np.testing.assert_allclose(abs(vector @ axis), math.pi, rtol=0, atol=1e-7)


def test_logarithm_of_the_transpose_is_the_opposite(rng: np.random.Generator) -> None:
    for _ in range(50):
        matrix = random_rotation(rng).as_matrix()
        np.testing.assert_allclose(log(matrix.T)[0], -log(matrix)[0], rtol=0, atol=1e-13)


def test_quaternions_agree_with_scipy_in_every_branch(rng: np.random.Generator) -> None:
    quaternion, matrix = np.empty(4), np.empty((3, 3))
    largest_components = set()
    for _ in range(200):
        rotation = random_rotation(rng)
        expected = wxyz(rotation) * (1.0 if wxyz(rotation)[0] >= 0.0 else -1.0)
        quaternion_from_matrix(rotation.as_matrix(), quaternion)
        np.testing.assert_allclose(quaternion, expected, rtol=0, atol=1e-14)
        matrix_from_quaternion(quaternion, matrix)
        np.testing.assert_allclose(matrix, rotation.as_matrix(), rtol=0, atol=1e-14)
        largest_components.add(int(np.argmax(np.abs(quaternion))))
    assert largest_components == {0, 1, 2, 3}


def test_a_quaternion_means_the_same_at_any_length_and_sign(rng: np.random.Generator) -> None:
    for _ in range(50):
        rotation, matrix = random_rotation(rng), np.empty((3, 3))
        factor = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-2, 2)
        matrix_from_quaternion(factor * wxyz(rotation), matrix)
        np.testing.assert_allclose(matrix, rotation.as_matrix(), rtol=0, atol=1e-14)


def test_products_are_numpys(rng: np.random.Generator) -> None:
    left, right, vector = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)
    product, turned = np.empty((3, 3)), np.empty(3)
    multiply(left, right, product)
    np.testing.assert_allclose(product, left @ right, rtol=0, atol=1e-14)
    multiply_transposed(left, right, product)
    np.testing.assert_allclose(product, left @ right.T, rtol=0, atol=1e-14)
    apply(left, vector, turned)
    np.testing.assert_allclose(turned, left @ vector, rtol=0, atol=1e-14)


def test_orthonormalize_takes_out_rounding_and_nothing_else(rng: np.random.Generator) -> None:
    for _ in range(50):
        exact = random_rotation(rng).as_matrix()
        matrix = exact + rng.uniform(-1e-9, 1e-9, size=(3, 3))
        orthonormalize(matrix)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=4e-15)
        assert np.linalg.det(matrix) == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_allclose(matrix, exact, rtol=0, atol=1e-8)


def test_angle_between_is_a_distance_that_turning_both_keeps(rng: np.random.Generator) -> None:
    for _ in range(50):
        a, b, c = (random_rotation(rng).as_matrix() for _ in range(3))
        angle = angle_between(a, b)
        assert angle == pytest.approx(Rotation.from_matrix(a @ b.T).magnitude(), abs=1e-12)
        assert angle_between(b, a) == pytest.approx(angle, abs=1e-12)
        assert angle_between(c @ a, c @ b) == pytest.approx(angle, abs=1e-12)
        assert angle_between(a, c) + angle_between(c, b) >= angle - 1e-12
        assert angle_between(a, a) < 1e-14
