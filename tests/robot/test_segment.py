"""The continuum segment: an arc, its derivatives, and the straight segment as an ordinary point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.segment import (
    STRAIGHT,
    jacobian,
    jacobian_polar,
    polar,
    rectangular,
    shape_frames,
    tip_position,
    tip_rotation,
)
from tests import own_kinematics
from tests.robot.differences import twist_columns

LENGTH = 0.03
BENDS = (0.0, 1e-9, 1e-5, 0.999 * STRAIGHT, 1.001 * STRAIGHT, 0.01, 0.5, math.pi / 2, 2.9)


def tip(uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position, rotation = np.empty(3), np.empty((3, 3))
    tip_position(uv[0], uv[1], LENGTH, position)
    tip_rotation(uv[0], uv[1], rotation)
    return position, rotation


def derivative(uv: np.ndarray) -> np.ndarray:
    out = np.empty((6, 2))
    jacobian(uv[0], uv[1], LENGTH, out)
    return out


def polar_derivative(theta: float, delta: float) -> np.ndarray:
    out = np.empty((6, 2))
    jacobian_polar(theta, delta, LENGTH, out)
    return out


def towards(delta: float) -> np.ndarray:
    return np.array([math.cos(delta), math.sin(delta)])


@pytest.mark.parametrize("phi", BENDS)
def test_tip_is_the_paper_s_arc(phi: float, rng: np.random.Generator) -> None:
    for delta in rng.uniform(-math.pi, math.pi, 20):
        position, rotation = tip(phi * towards(delta))
        expected, turn = own_kinematics.segment(0.5 * math.pi - phi, delta, LENGTH)
        # The oracle's own theta = pi/2 - phi keeps only sixteen digits of pi/2.
        np.testing.assert_allclose(position, expected, rtol=0, atol=LENGTH * 1e-7)
        np.testing.assert_allclose(rotation, turn, rtol=0, atol=3e-15)


@pytest.mark.parametrize("phi", BENDS)
def test_tip_is_the_end_of_a_curve_of_constant_curvature(
    phi: float, rng: np.random.Generator
) -> None:
    """The backbone's tangent, integrated along its length."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    for delta in rng.uniform(-math.pi, math.pi, 10):
        u, v = phi * towards(delta)
        along = 0.5 * (nodes[:, None] + 1.0) * np.array([[v, u, 0.0]])
        tangents = Rotation.from_rotvec(along).apply([0.0, 0.0, 1.0])
        position, rotation = tip(np.array([u, v]))
        np.testing.assert_allclose(
            position, 0.5 * LENGTH * weights @ tangents, rtol=0, atol=LENGTH * 1e-14
        )
        expected = Rotation.from_rotvec([v, u, 0.0]).as_matrix()
        np.testing.assert_allclose(rotation, expected, rtol=0, atol=2e-15)


@pytest.mark.parametrize("phi", BENDS)
def test_jacobian_is_the_derivative(phi: float, rng: np.random.Generator) -> None:
    for delta in rng.uniform(-math.pi, math.pi, 20):
        uv = phi * towards(delta)
        # A step much longer than the series' reach, extrapolated once, crosses the switch.
        coarse, fine = twist_columns(tip, uv, 2e-3), twist_columns(tip, uv, 1e-3)
        expected = (4.0 * fine - coarse) / 3.0
        np.testing.assert_allclose(derivative(uv), expected, rtol=0, atol=1e-11)


def test_jacobian_does_not_jump_where_the_series_takes_over(rng: np.random.Generator) -> None:
    for delta in rng.uniform(-math.pi, math.pi, 50):
        inside = derivative(STRAIGHT * (1.0 - 1e-12) * towards(delta))
        outside = derivative(STRAIGHT * (1.0 + 1e-12) * towards(delta))
        np.testing.assert_allclose(inside, outside, rtol=0, atol=1e-13)


def test_straight_is_an_ordinary_point(rng: np.random.Generator) -> None:
    at_straight = derivative(np.zeros(2))
    expected = np.array([[LENGTH / 2, 0], [0, -LENGTH / 2], [0, 0], [0, 1], [1, 0], [0, 0]])
    np.testing.assert_allclose(at_straight, expected, rtol=0, atol=1e-17)
    assert np.linalg.matrix_rank(at_straight[3:5]) == 2
    for delta in rng.uniform(-math.pi, math.pi, 20):
        near = derivative(1e-7 * towards(delta))
        np.testing.assert_allclose(near, at_straight, rtol=0, atol=1e-7)


def test_leaning_directions() -> None:
    """The tip leans to (u, -v) / phi."""
    for uv, lean in (((1, 0), (1, 0)), ((-1, 0), (-1, 0)), ((0, 1), (0, -1)), ((0, -1), (0, 1))):
        position, rotation = tip(np.array(uv, float))
        np.testing.assert_allclose(position[:2] / np.linalg.norm(position[:2]), lean, atol=1e-15)
        np.testing.assert_allclose(rotation[:2, 2], math.sin(1.0) * np.array(lean), atol=1e-15)


def test_polar_angular_columns_are_equation_17(rng: np.random.Generator) -> None:
    for _ in range(50):
        theta, delta = rng.uniform(-1.2, 1.5), rng.uniform(-math.pi, math.pi)
        st, ct, sd, cd = math.sin(theta), math.cos(theta), math.sin(delta), math.cos(delta)
        expected = [[-sd, cd * ct], [-cd, -sd * ct], [0.0, st - 1.0]]
        np.testing.assert_allclose(polar_derivative(theta, delta)[3:], expected, rtol=0, atol=1e-14)


def test_polar_columns_are_derivatives_in_theta_and_delta(rng: np.random.Generator) -> None:
    def pose(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return own_kinematics.segment(at[0], at[1], LENGTH)

    for _ in range(50):
        at = np.array([rng.uniform(-1.2, 1.4), rng.uniform(-math.pi, math.pi)])
        np.testing.assert_allclose(
            polar_derivative(*at), twist_columns(pose, at), rtol=0, atol=1e-9
        )


def test_delta_does_nothing_at_the_straight_segment(rng: np.random.Generator) -> None:
    for delta in rng.uniform(-math.pi, math.pi, 10):
        assert not polar_derivative(0.5 * math.pi, delta)[:, 1].any()


def test_polar_and_rectangular_undo_each_other(rng: np.random.Generator) -> None:
    for _ in range(100):
        uv = rng.uniform(0, 2.9) * towards(rng.uniform(-math.pi, math.pi))
        np.testing.assert_allclose(rectangular(*polar(*uv)), uv, rtol=0, atol=4e-15)
    assert polar(0.0, 0.0) == (0.5 * math.pi, 0.0)


@pytest.mark.parametrize("phi", [0.0, 0.4, 1.5])
def test_backbone_frames_lie_on_the_arc(phi: float, rng: np.random.Generator) -> None:
    uv = phi * towards(rng.uniform(-math.pi, math.pi))
    fractions = np.linspace(0.0, 1.0, 12)
    positions, rotations = shape_frames(uv[0], uv[1], LENGTH, fractions)
    np.testing.assert_allclose(positions[0], 0.0, atol=1e-18)
    np.testing.assert_allclose(positions[-1], tip(uv)[0], rtol=0, atol=1e-17)
    np.testing.assert_allclose(rotations[-1], tip(uv)[1], rtol=0, atol=1e-15)
    # Equal arcs have equal chords, and the turn grows evenly.
    chords = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    half = 0.5 * phi / 11
    chord = LENGTH / 11 * (math.sin(half) / half if phi > 0.0 else 1.0)
    np.testing.assert_allclose(chords, chord, rtol=1e-12)
    for fraction, rotation in zip(fractions, rotations, strict=True):
        angle = own_kinematics.angle_between(rotation, np.eye(3))
        assert angle == pytest.approx(phi * fraction, abs=1e-12)
