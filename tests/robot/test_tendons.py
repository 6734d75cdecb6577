"""Tendons, pulleys and servos: geometry, the paper's formulas, and both ways."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.segment import tip_position
from robot.tendons import (
    angles_from_ticks,
    bend_from_servos,
    servo_angles,
    servo_jacobian_polar,
    tendon_lengths,
    ticks_from_angles,
)

PITCH, PULLEY, LENGTH = 0.0018, 0.0054, 0.03
TICKS = 4096


def lengths(u: float, v: float) -> np.ndarray:
    out = np.empty(4)
    tendon_lengths(u, v, PITCH, out)
    return out


def servos(u: float, v: float) -> np.ndarray:
    out = np.empty(4)
    servo_angles(u, v, PITCH, PULLEY, out)
    return out


def random_uv(rng: np.random.Generator) -> tuple[float, float]:
    phi, delta = rng.uniform(0, 2.5), rng.uniform(-math.pi, math.pi)
    return phi * math.cos(delta), phi * math.sin(delta)


def test_lengths_are_equation_75(rng: np.random.Generator) -> None:
    for _ in range(50):
        theta, delta = rng.uniform(-1.0, 0.5 * math.pi), rng.uniform(-math.pi, math.pi)
        phi = 0.5 * math.pi - theta
        offsets = [PITCH * math.cos(delta + i * 0.5 * math.pi) for i in range(4)]
        expected = [offset * (theta - 0.5 * math.pi) for offset in offsets]
        actual = lengths(phi * math.cos(delta), phi * math.sin(delta))
        np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-17)


def test_lengths_are_those_of_curves_beside_the_backbone(rng: np.random.Generator) -> None:
    """Tendon i stands at +(i-1) 90 degrees, right-handed about z from x; its path is measured."""
    stations = np.linspace(0.0, 1.0, 4001)
    for _ in range(5):
        u, v = random_uv(rng)
        turns = Rotation.from_rotvec(stations[:, None] * np.array([[v, u, 0.0]]))
        backbone = np.empty((len(stations), 3))
        for row, share in zip(backbone, stations, strict=True):
            tip_position(u * share, v * share, LENGTH * share, row)
        for index in range(4):
            angle = index * 0.5 * math.pi
            offset = [PITCH * math.cos(angle), PITCH * math.sin(angle), 0.0]
            curve = backbone + turns.apply(offset)
            path = float(np.sum(np.linalg.norm(np.diff(curve, axis=0), axis=1)))
            assert path - LENGTH == pytest.approx(lengths(u, v)[index], abs=2e-9)


@pytest.mark.parametrize(
    ("uv", "pulled", "lean"),
    [((1, 0), 0, (1, 0)), ((-1, 0), 2, (-1, 0)), ((0, 1), 3, (0, -1)), ((0, -1), 1, (0, 1))],
)
def test_the_tip_leans_to_the_tendon_that_is_pulled(
    uv: tuple[float, float], pulled: int, lean: tuple[float, float]
) -> None:
    changes, position = lengths(*uv), np.empty(3)
    tip_position(*uv, LENGTH, position)
    assert int(np.argmin(changes)) == pulled
    assert changes[pulled] == -PITCH
    assert changes[(pulled + 2) % 4] == PITCH
    np.testing.assert_allclose(position[:2] / np.linalg.norm(position[:2]), lean, atol=1e-15)
    standing = (math.cos(0.5 * math.pi * pulled), math.sin(0.5 * math.pi * pulled))
    np.testing.assert_allclose(standing, lean, atol=1e-15)


def test_servos_and_bend_undo_each_other(rng: np.random.Generator) -> None:
    for _ in range(100):
        uv = random_uv(rng)
        np.testing.assert_allclose(
            bend_from_servos(servos(*uv), PITCH, PULLEY), uv, rtol=0, atol=1e-15
        )


def test_disagreeing_servos_are_fitted_in_the_least_squares_sense(rng: np.random.Generator) -> None:
    model = np.column_stack([servos(1.0, 0.0), servos(0.0, 1.0)])
    for _ in range(50):
        measured = rng.uniform(-1, 1, 4)
        expected = np.linalg.lstsq(model, measured, rcond=None)[0]
        np.testing.assert_allclose(
            bend_from_servos(measured, PITCH, PULLEY), expected, rtol=0, atol=1e-14
        )


def test_opposite_tendons_never_fight(rng: np.random.Generator) -> None:
    for _ in range(50):
        angles = servos(*random_uv(rng))
        assert angles[0] == -angles[2]
        assert angles[1] == -angles[3]


def test_polar_servo_jacobian_is_the_derivative(rng: np.random.Generator) -> None:
    def at(theta: float, delta: float) -> np.ndarray:
        phi = 0.5 * math.pi - theta
        return servos(phi * math.cos(delta), phi * math.sin(delta))

    step = 1e-6
    for _ in range(50):
        theta, delta = rng.uniform(-1.0, 0.5 * math.pi), rng.uniform(-math.pi, math.pi)
        by_theta = (at(theta + step, delta) - at(theta - step, delta)) / (2 * step)
        by_delta = (at(theta, delta + step) - at(theta, delta - step)) / (2 * step)
        np.testing.assert_allclose(
            servo_jacobian_polar(theta, delta, PITCH, PULLEY),
            np.column_stack([by_theta, by_delta]),
            rtol=0,
            atol=1e-9,
        )


def test_servo_ticks_round_to_the_nearest_and_come_back(rng: np.random.Generator) -> None:
    resolution = 2.0 * math.pi / TICKS
    for _ in range(100):
        uv = random_uv(rng)
        angles = servos(*uv)
        ticks = ticks_from_angles(angles, TICKS)
        assert ticks.dtype == np.int64
        back = angles_from_ticks(ticks, TICKS)
        assert np.abs(back - angles).max() <= 0.5 * resolution * (1 + 1e-12)
        assert np.array_equal(ticks_from_angles(back, TICKS), ticks)
        found = bend_from_servos(back, PITCH, PULLEY)
        assert np.abs(np.subtract(found, uv)).max() <= 0.5 * resolution * PULLEY / PITCH * 1.001


def test_a_full_servo_turn_is_all_ticks() -> None:
    angles = np.array([2.0 * math.pi, -2.0 * math.pi, 0.0, math.pi])
    assert ticks_from_angles(angles, TICKS).tolist() == [TICKS, -TICKS, 0, TICKS // 2]
