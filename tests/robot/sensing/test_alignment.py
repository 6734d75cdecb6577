"""A late pose is met with what was measured when it was taken."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.records import STATE
from robot.segment import tip_position, tip_rotation
from robot.sensing.alignment import EVERY_S, REACH_S, carry_on, recall, remember
from robot.tendons import servo_angles

DT = 0.002


def at(time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What is measured at a time: a shaft that moves and turns, servos, tensions."""
    wxyz = np.roll(Rotation.from_rotvec([0.0, 0.4 * time, 0.0]).as_quat(), 1)
    servo = np.array([1.0, -1.0, 0.5, 2.0]) * time
    return np.array([0.1 * time, 0.0, 0.2]), wxyz, servo, 2.0 + servo


def remembering(seconds: float) -> np.ndarray:
    state = np.zeros(1, STATE)
    for tick in range(1, round(seconds / DT) + 1):
        remember(state[0], DT, *at(tick * DT))
    return state


def test_what_was_measured_between_two_entries_is_interpolated() -> None:
    state = remembering(0.5)
    for age in (0.0, 0.0031, 0.02, 0.0475, REACH_S - EVERY_S):
        place, turn, servo = np.empty(3), np.empty((3, 3)), np.empty(4)
        assert recall(state[0], age, place, turn, servo)
        position, wxyz, expected, _ = at(0.5 - age)
        # Beyond the newest entry nothing is known yet: it stands for at most one interval.
        slack = EVERY_S if age < EVERY_S else 1e-9
        assert place == pytest.approx(position, abs=0.1 * slack)
        assert servo == pytest.approx(expected, abs=2.0 * slack)
        rotation = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
        assert turn == pytest.approx(rotation, abs=0.4 * slack + 1e-7)


def test_of_a_time_before_the_ring_nothing_is_known() -> None:
    place, turn, servo = np.empty(3), np.empty((3, 3)), np.empty(4)
    assert not recall(remembering(0.5)[0], REACH_S + EVERY_S, place, turn, servo)
    assert not recall(remembering(0.01)[0], 0.02, place, turn, servo)
    assert not recall(np.zeros(1, STATE)[0], 0.0, place, turn, servo)


def test_a_pose_is_carried_on_by_the_bend_since(rng: np.random.Generator) -> None:
    then, now, later = np.empty(4), np.empty(4), np.empty(3)
    turn = np.empty((3, 3))
    for u, v in rng.uniform(-1.0, 1.0, size=(10, 2)):
        servo_angles(u, v, 0.0018, 0.0054, then)
        servo_angles(u + 0.1, v - 0.05, 0.0018, 0.0054, now)
        position, rotation = np.empty(3), np.empty((3, 3))
        tip_position(u, v, 0.03, position)
        tip_rotation(u, v, rotation)
        carry_on(then, now, 0.0018, 0.0054, 0.03, position, rotation)
        tip_position(u + 0.1, v - 0.05, 0.03, later)
        tip_rotation(u + 0.1, v - 0.05, turn)
        assert position == pytest.approx(later, abs=1e-15)
        assert rotation == pytest.approx(turn, abs=1e-14)


def test_quaternions_of_either_sign_are_one_rotation() -> None:
    state = np.zeros(1, STATE)
    for tick in range(1, 40):
        place, wxyz, servo, tension = at(tick * DT)
        remember(state[0], DT, place, wxyz * (-1.0) ** (tick // 2), servo, tension)
    place, turn, servo = np.empty(3), np.empty((3, 3)), np.empty(4)
    assert recall(state[0], 0.021, place, turn, servo)
    assert math.isclose(float(np.linalg.det(turn)), 1.0, abs_tol=1e-9)
    expected = Rotation.from_rotvec([0.0, 0.4 * (39 * DT - 0.021), 0.0]).as_matrix()
    assert turn == pytest.approx(expected, abs=1e-6)
