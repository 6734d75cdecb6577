"""Sensors aligned in time: a tracker's late pose is met with what was measured when it was taken.

Measurements are kept in a ring, one every ``EVERY_S``. Between two of them they are interpolated;
a pose that is older than the ring is not used. From its own time to now the pose is carried on by
the bend that the tendons have made since.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.records import RecordFields
from robot.rotations import matrix_from_quaternion
from robot.segment import tip_position, tip_rotation
from robot.sensing.records import SENSED_COUNT
from robot.tendons import bend_from_servos

EVERY_S = 0.004
REACH_S = EVERY_S * (SENSED_COUNT - 1)
"""A pose that is older than this cannot be met with anything."""


@compiled
def remember(
    s: RecordFields,
    dt: float,
    shaft_position: np.ndarray,
    shaft_wxyz: np.ndarray,
    servo: np.ndarray,
    tension: np.ndarray,
) -> None:
    """Let time pass, and keep what is measured now if it is time for it.

    Args:
        s: state, changed.
        dt: of the tick, s.
        shaft_position: (3,) of the shaft's end, base frame, m.
        shaft_wxyz: (4,) its orientation.
        servo: (4,) rad.
        tension: (4,) N.
    """
    s.sensed_time += dt
    if s.sensed_count > 0:
        newest = s.sensed[(s.sensed_count - 1) % SENSED_COUNT]
        if s.sensed_time - newest.time < EVERY_S - 0.25 * dt:
            return
    entry = s.sensed[s.sensed_count % SENSED_COUNT]
    entry.time = s.sensed_time
    for i in range(3):
        entry.shaft_position[i] = shaft_position[i]
    for i in range(4):
        entry.shaft_wxyz[i] = shaft_wxyz[i]
        entry.servo[i] = servo[i]
        entry.tension[i] = tension[i]
    s.sensed_count += 1


@compiled
def mean_tension(s: RecordFields, tendon: int) -> float:
    """What a tendon carried on average since the oldest measurement that is kept, N; without those
    that are no number, and NaN where there are no others.
    """
    total, count = 0.0, 0
    for back in range(min(s.sensed_count, SENSED_COUNT)):
        tension = s.sensed[back].tension[tendon]
        if math.isfinite(tension):
            total += tension
            count += 1
    return total / count if count > 0 else math.nan


@compiled
def recall(
    s: RecordFields,
    age: float,
    shaft_position: np.ndarray,
    shaft_rotation: np.ndarray,
    servo: np.ndarray,
) -> bool:
    """What was measured ``age`` s ago; False where nothing is known of that time.

    Args:
        s: state.
        age: s.
        shaft_position: (3,) filled, m.
        shaft_rotation: (3, 3) filled.
        servo: (4,) filled, rad.
    """
    count = min(s.sensed_count, SENSED_COUNT)
    time = s.sensed_time - age
    for back in range(1, count):
        later = s.sensed[(s.sensed_count - back) % SENSED_COUNT]
        earlier = s.sensed[(s.sensed_count - back - 1) % SENSED_COUNT]
        if earlier.time > time:
            continue
        # Newer than the newest entry by less than one interval: carried on from it.
        share = min((time - earlier.time) / (later.time - earlier.time), 1.0)
        wxyz, norm, dot = np.empty(4), 0.0, 0.0
        for i in range(4):
            dot += earlier.shaft_wxyz[i] * later.shaft_wxyz[i]
        for i in range(4):
            end = later.shaft_wxyz[i] if dot >= 0.0 else -later.shaft_wxyz[i]
            wxyz[i] = (1.0 - share) * earlier.shaft_wxyz[i] + share * end
            norm += wxyz[i] * wxyz[i]
            servo[i] = (1.0 - share) * earlier.servo[i] + share * later.servo[i]
        for i in range(4):
            wxyz[i] /= math.sqrt(norm)
        for i in range(3):
            start = earlier.shaft_position[i]
            shaft_position[i] = start + share * (later.shaft_position[i] - start)
        matrix_from_quaternion(wxyz, shaft_rotation)
        return True
    return False


@compiled
def carry_on(
    then: np.ndarray,
    now: np.ndarray,
    pitch_radius: float,
    pulley_radius: float,
    length: float,
    position: np.ndarray,
    rotation: np.ndarray,
) -> None:
    """Move a tip pose by the bend that the servos have made since it was seen.

    Args:
        then: (4,) servo angles when it was seen, rad.
        now: (4,) servo angles now.
        pitch_radius: m.
        pulley_radius: m.
        length: of the segment, m.
        position: (3,) in the segment's base frame, m; changed.
        rotation: (3, 3) likewise.
    """
    u0, v0 = bend_from_servos(then, pitch_radius, pulley_radius)
    u1, v1 = bend_from_servos(now, pitch_radius, pulley_radius)
    before, after = np.empty(3), np.empty(3)
    turn_before, turn_after, turned = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    tip_position(u0, v0, length, before)
    tip_position(u1, v1, length, after)
    tip_rotation(u0, v0, turn_before)
    tip_rotation(u1, v1, turn_after)
    step = turn_after @ np.ascontiguousarray(turn_before.T)
    turned[:] = step @ rotation
    for i in range(3):
        position[i] += after[i] - before[i]
        for j in range(3):
            rotation[i, j] = turned[i, j]
