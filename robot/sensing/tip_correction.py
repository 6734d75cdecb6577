"""A tracker of the tip, taken as a slow correction.

The controller goes on linearising at what it commands. What the tracker adds is the difference
between the tip it saw and the tip that was commanded at that time, taken over a share at a time;
the controller then aims that much to the other side. So a late and noisy tracker cannot shake the
robot, and what is constant or slow vanishes from the error.
"""

from __future__ import annotations

import math

import numpy as np

from robot.commands import rotation_error
from robot.compiled import compiled
from robot.records import RecordFields
from robot.rotations import (
    exponential,
    matrix_from_quaternion,
    multiply,
    orthonormalize,
    quaternion_from_matrix,
)

OLDEST_S = 0.5
"""A sample older than this is not taken."""
_FADE_PER_S = 4.0


@compiled
def start_correction(s: RecordFields) -> None:
    """Forget every correction; what a sample is compared with is the commanded tip."""
    for i in range(3):
        s.lagged_position[i] = s.tip_position[i]
        s.correction_position[i] = 0.0
        s.correction_rotation[i] = 0.0
        for j in range(3):
            s.lagged_rotation[i, j] = s.tip_rotation[i, j]


@compiled
def follow_tip(s: RecordFields, dt: float, delay: float) -> None:
    """Let the lagged tip follow the commanded one ``delay`` s behind."""
    share = 1.0 if delay <= 0.0 else 1.0 - math.exp(-dt / delay)
    vector, step, turned = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    rotation_error(s.tip_rotation, s.lagged_rotation, vector)
    for i in range(3):
        s.lagged_position[i] += share * (s.tip_position[i] - s.lagged_position[i])
        vector[i] *= share
    exponential(vector, step)
    multiply(step, s.lagged_rotation, turned)
    orthonormalize(turned)
    for i in range(3):
        for j in range(3):
            s.lagged_rotation[i, j] = turned[i, j]


@compiled
def _usable(tracker: RecordFields) -> bool:
    total = tracker.age_s
    norm = 0.0
    for k in range(3):
        total += abs(tracker.position[k])
    for k in range(4):
        norm += tracker.wxyz[k] * tracker.wxyz[k]
    recent = tracker.age_s <= OLDEST_S
    return bool(recent and math.isfinite(total + norm) and abs(norm - 1.0) < 1e-3)


@compiled
def take_sample(s: RecordFields, tracker: RecordFields, parameters: np.ndarray) -> None:
    """Take over a share of what a new sample says that the commanded tip is off.

    A sample that is farther off than a leader may jump is not believed.

    Args:
        s: state, changed.
        tracker: () ``TRACKER``.
        parameters: (1,).
    """
    if tracker.sequence == s.tracker_sequence or not _usable(tracker):
        return
    s.tracker_sequence = tracker.sequence
    p = parameters[0]
    seen, turn = np.empty((3, 3)), np.empty(3)
    matrix_from_quaternion(tracker.wxyz, seen)
    angle = rotation_error(seen, s.lagged_rotation, turn)
    square = 0.0
    for i in range(3):
        square += (tracker.position[i] - s.lagged_position[i]) ** 2
    if math.sqrt(square) > p.jump_position or angle > p.jump_angle:
        return
    for i in range(3):
        off = tracker.position[i] - s.lagged_position[i]
        s.correction_position[i] += p.correction_gain * (off - s.correction_position[i])
        s.correction_rotation[i] += p.correction_gain * (turn[i] - s.correction_rotation[i])


@compiled
def correct(s: RecordFields, tracker: RecordFields, use: bool, dt: float, p: np.ndarray) -> None:
    """Take a new sample, or let the correction fade where the tracker is not to be used."""
    if use:
        take_sample(s, tracker, p)
        return
    left = math.exp(-_FADE_PER_S * dt)
    for i in range(3):
        s.correction_position[i] *= left
        s.correction_rotation[i] *= left


@compiled
def expected_pose(outcome: np.ndarray, position: np.ndarray, wxyz: np.ndarray) -> None:
    """Where the tip is, as far as is known, of a (1,) outcome: (3,) in m and (4,) quaternion."""
    rotation = np.empty((3, 3))
    expected_tip(outcome[0].state, position, rotation)
    quaternion_from_matrix(rotation, wxyz)


@compiled
def expected_tip(s: RecordFields, position: np.ndarray, rotation: np.ndarray) -> None:
    """Where the tip is, as far as is known: the commanded tip, corrected."""
    turn = np.empty((3, 3))
    exponential(s.correction_rotation, turn)
    multiply(turn, s.tip_rotation, rotation)
    for i in range(3):
        position[i] = s.tip_position[i] + s.correction_position[i]


@compiled
def aim(
    s: RecordFields,
    desired_position: np.ndarray,
    desired_rotation: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
) -> None:
    """The pose to command so that the tip comes to the desired one; both in the base frame."""
    turn = np.empty((3, 3))
    exponential(s.correction_rotation, turn)
    back = np.ascontiguousarray(turn.T)
    multiply(back, desired_rotation, rotation)
    for i in range(3):
        position[i] = desired_position[i] - s.correction_position[i]
