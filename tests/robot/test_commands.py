"""Resolved rates, eqs. (92)-(101): the paper's law, and feed-forward."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.commands import correction_gains, resolved_speed, rotation_error, tip_twist
from tests.robot.drive import DT, random_rotation

MAX, MIN, GAMMA, EPSILON = 0.03, 0.002, 1e-4, 20.0


def unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


class Scene:
    """Where the tip shall be, should have been, and is."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.tip = rng.uniform(-1, 1, 3)
        self.tip_rotation = random_rotation(rng)
        self.previous, self.previous_rotation = self.tip, self.tip_rotation
        self.desired, self.desired_rotation = self.tip, self.tip_rotation

    def twist(
        self, parameters: np.ndarray, *, feed_forward: bool, together: bool = False
    ) -> np.ndarray:
        out = np.empty(6)
        tip_twist(
            self.desired,
            self.desired_rotation.as_matrix(),
            self.previous,
            self.previous_rotation.as_matrix(),
            self.tip,
            self.tip_rotation.as_matrix(),
            DT,
            feed_forward,
            together,
            parameters,
            out,
        )
        return out


def speed(error: float) -> float:
    return resolved_speed(error, MAX, MIN, GAMMA, EPSILON)


def test_no_speed_up_to_the_threshold() -> None:
    assert [speed(error) for error in (0.0, 0.5 * GAMMA, GAMMA)] == [0.0, 0.0, 0.0]
    assert speed(GAMMA * (1 + 1e-9)) == pytest.approx(MIN, rel=1e-6)


def test_the_ramp_ends_at_the_largest_speed_without_a_step() -> None:
    end = EPSILON * GAMMA
    assert speed(end * (1 - 1e-9)) == pytest.approx(MAX, rel=1e-6)
    assert speed(end) == pytest.approx(MAX, rel=1e-12)
    assert speed(end * (1 + 1e-9)) == MAX
    assert speed(1e3) == MAX


def test_the_speed_follows_equations_98_and_99(rng: np.random.Generator) -> None:
    errors = np.sort(rng.uniform(GAMMA, EPSILON * GAMMA, 100))
    speeds = [speed(error) for error in errors]
    chi = (errors - GAMMA) / (GAMMA * (EPSILON - 1.0))
    np.testing.assert_allclose(speeds, MIN + (MAX - MIN) * chi, rtol=1e-12)
    assert np.all(np.diff(speeds) > 0.0)


def test_the_twist_points_along_the_errors(
    parameters: np.ndarray, rng: np.random.Generator
) -> None:
    p = parameters[0]
    for _ in range(50):
        scene = Scene(rng)
        offset, turn = rng.uniform(0, 0.005) * unit(rng), rng.uniform(0, 3.0) * unit(rng)
        scene.desired = scene.tip + offset
        scene.desired_rotation = Rotation.from_rotvec(turn) * scene.tip_rotation
        twist = scene.twist(parameters, feed_forward=False)
        distance, angle = float(np.linalg.norm(offset)), float(np.linalg.norm(turn))
        linear = resolved_speed(
            distance, p["speed_max"], p["speed_min"], p["position_threshold"], p["position_ramp"]
        )
        angular = resolved_speed(
            angle,
            p["angular_speed_max"],
            p["angular_speed_min"],
            p["orientation_threshold"],
            p["orientation_ramp"],
        )
        np.testing.assert_allclose(twist[:3], linear * offset / distance, rtol=0, atol=1e-12)
        np.testing.assert_allclose(twist[3:], angular * turn / angle, rtol=0, atol=1e-11)


@pytest.mark.parametrize("feed_forward", [False, True])
def test_nothing_to_do_is_no_twist(
    parameters: np.ndarray, rng: np.random.Generator, feed_forward: bool
) -> None:
    scene = Scene(rng)
    twist = scene.twist(parameters, feed_forward=feed_forward)
    np.testing.assert_allclose(twist, 0.0, rtol=0, atol=1e-13)


@pytest.mark.parametrize("feed_forward", [False, True])
def test_half_a_turn_off_is_turned_back_at_the_largest_speed(
    parameters: np.ndarray, rng: np.random.Generator, feed_forward: bool
) -> None:
    """Where the printed (95), (96) divide by sin(pi)."""
    for _ in range(20):
        scene = Scene(rng)
        half_turn = Rotation.from_rotvec(math.pi * unit(rng))
        scene.desired_rotation = scene.previous_rotation = half_turn * scene.tip_rotation
        twist = scene.twist(parameters, feed_forward=feed_forward)
        assert np.all(np.isfinite(twist))
        largest = parameters[0]["angular_speed_max"]
        assert np.linalg.norm(twist[3:]) == pytest.approx(largest, rel=1e-9)


def test_feed_forward_lands_on_the_desired_pose(
    parameters: np.ndarray, rng: np.random.Generator
) -> None:
    for _ in range(50):
        scene = Scene(rng)
        scene.desired = scene.tip + rng.uniform(-1e-3, 1e-3, 3)
        step = Rotation.from_rotvec(rng.uniform(-0.02, 0.02, 3))
        scene.desired_rotation = step * scene.tip_rotation
        twist = scene.twist(parameters, feed_forward=True)
        np.testing.assert_allclose(scene.tip + DT * twist[:3], scene.desired, rtol=0, atol=1e-15)
        turned = Rotation.from_rotvec(DT * twist[3:]) * scene.tip_rotation
        assert (turned * scene.desired_rotation.inv()).magnitude() < 1e-13


def test_what_was_left_over_is_taken_back_without_a_dead_zone(
    parameters: np.ndarray, rng: np.random.Generator
) -> None:
    p = parameters[0]
    linear = p["speed_max"] / (p["position_ramp"] * p["position_threshold"])
    angular = p["angular_speed_max"] / (p["orientation_ramp"] * p["orientation_threshold"])
    for size in (1e-9, 1e-6, 0.5 * p["position_threshold"]):
        scene = Scene(rng)
        offset, turn = size * unit(rng), size * unit(rng)
        scene.desired = scene.previous = scene.tip + offset
        scene.previous_rotation = Rotation.from_rotvec(turn) * scene.tip_rotation
        scene.desired_rotation = scene.previous_rotation
        twist = scene.twist(parameters, feed_forward=True)
        np.testing.assert_allclose(twist[:3], linear * offset, rtol=1e-6, atol=1e-13)
        np.testing.assert_allclose(twist[3:], angular * turn, rtol=1e-6, atol=1e-13)


def test_the_correction_saturates_at_the_largest_speeds(
    parameters: np.ndarray, rng: np.random.Generator
) -> None:
    for _ in range(20):
        distance, angle = rng.uniform(0, 0.1), rng.uniform(0, 3.0)
        linear, angular = correction_gains(distance, angle, False, parameters)
        assert linear * distance <= parameters[0]["speed_max"] * (1 + 1e-12)
        assert angular * angle <= parameters[0]["angular_speed_max"] * (1 + 1e-12)


def test_a_shared_level_slows_both_commands_alike(
    parameters: np.ndarray, rng: np.random.Generator
) -> None:
    """Otherwise the weighted error that the level minimises would become another one."""
    for _ in range(20):
        distance, angle = rng.uniform(0, 0.1), rng.uniform(0, 3.0)
        apart = correction_gains(distance, angle, False, parameters)
        assert correction_gains(distance, angle, True, parameters) == (min(apart), min(apart))


def test_rotation_error_turns_the_one_into_the_other(rng: np.random.Generator) -> None:
    vector = np.empty(3)
    for _ in range(50):
        desired, current = random_rotation(rng), random_rotation(rng)
        angle = rotation_error(desired.as_matrix(), current.as_matrix(), vector)
        assert angle == pytest.approx(np.linalg.norm(vector), abs=1e-12)
        reached = Rotation.from_rotvec(vector) * current
        np.testing.assert_allclose(reached.as_matrix(), desired.as_matrix(), rtol=0, atol=1e-13)
