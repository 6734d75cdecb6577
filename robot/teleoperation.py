"""From the leader's motion to the desired tip pose. Paper 1, eqs. (88)-(91), as one must read them.

With the full transform of (90), turning the stylus would move the tip by (I - R) t, t being the
distance between stylus and tip. So the similarity of (89) uses the rotation part of (90) only, the
translation is anchored, and the motion scale acts on the translation only:

    p_desired = p_tip_anchor + scale * R_bl (p_leader - p_leader_anchor)
    R_desired = R_bl (R_leader R_leader_anchor^T) R_bl^T R_tip_anchor

with R_bl turning leader motion into the base frame. At the moment of engagement both are the tip's
own pose, so closing the clutch never moves anything. The desired pose then runs toward this target
no faster than the speed limits.
"""

from __future__ import annotations

import math

import numpy as np

from robot.commands import rotation_error
from robot.compiled import compiled
from robot.records import Alignment, LeaderKind, RecordFields, Refusal, Safety
from robot.rotations import (
    angle_between,
    apply,
    exponential,
    matrix_from_quaternion,
    multiply,
    multiply_transposed,
    orthonormalize,
)
from robot.safety import Event, apply_event
from robot.sensing.tip_correction import expected_tip

_ENABLED = int(Safety.ENABLED)
_ARRIVED_M, _ARRIVED_RAD = 1e-9, 1e-9
_UNDER_WALL_M = 0.003
"""How far under the body wall a target must stay."""
_MATCHED = int(Alignment.MATCHED)
_JUMP, _INVALID = int(Event.LEADER_JUMP), int(Event.LEADER_INVALID)
_GIZMO, _PATH = int(LeaderKind.GIZMO), int(LeaderKind.PATH)
_TOO_FAR, _NOT_ALIGNED, _NO_HOLD = (
    int(Refusal.TARGET_TOO_FAR),
    int(Refusal.NOT_ALIGNED),
    int(Refusal.HOLD_NOT_PRESSED),
)
_OUTSIDE, _BEHIND = int(Refusal.OUTSIDE_WORKSPACE), int(Refusal.BEHIND_TROCAR)


@compiled
def _distance(a: np.ndarray, b: np.ndarray) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@compiled
def _valid(leader: RecordFields) -> bool:
    norm = 0.0
    for k in range(4):
        norm += leader.wxyz[k] * leader.wxyz[k]
    total = norm
    for k in range(3):
        total += abs(leader.position[k])
    return math.isfinite(total) and norm > 1e-6


@compiled
def _rotation_base_leader(leader: RecordFields, settings: RecordFields, out: np.ndarray) -> None:
    """What turns the leader's motion into the base frame; the gizmo moves in the base frame."""
    for i in range(3):
        for j in range(3):
            if leader.kind == _GIZMO:
                out[i, j] = 1.0 if i == j else 0.0
            else:
                out[i, j] = settings.rotation_base_leader[i, j]


@compiled
def _settings_changed(s: RecordFields, leader: RecordFields, settings: RecordFields) -> bool:
    if s.anchor_scale != settings.motion_scale:
        return True
    if s.anchor_lock_rotation != settings.lock_rotation:
        return True
    if s.anchor_lock_translation != settings.lock_translation:
        return True
    turn = np.empty((3, 3))
    _rotation_base_leader(leader, settings, turn)
    for i in range(3):
        for j in range(3):
            if s.anchor_rotation_base_leader[i, j] != turn[i, j]:
                return True
    return False


@compiled
def _anchor(
    s: RecordFields, leader: RecordFields, settings: RecordFields, rotation: np.ndarray
) -> None:
    """Take the leader's pose and the desired pose as the pair that belongs together."""
    _rotation_base_leader(leader, settings, s.anchor_rotation_base_leader)
    for i in range(3):
        s.anchor_leader_position[i] = leader.position[i]
        s.anchor_tip_position[i] = s.desired_position[i]
        for j in range(3):
            s.anchor_leader_rotation[i, j] = rotation[i, j]
            s.anchor_tip_rotation[i, j] = s.desired_rotation[i, j]
    s.anchor_scale = settings.motion_scale
    s.anchor_lock_rotation = settings.lock_rotation
    s.anchor_lock_translation = settings.lock_translation


@compiled
def relative_target(
    s: RecordFields,
    position: np.ndarray,
    rotation: np.ndarray,
    target_position: np.ndarray,
    target_rotation: np.ndarray,
) -> None:
    """Target pose of a clutched leader from the anchors in the state ``s``; eqs. (88)-(91)."""
    moved = np.empty(3)
    turned = np.empty(3)
    first = np.empty((3, 3))
    second = np.empty((3, 3))
    for i in range(3):
        moved[i] = s.anchor_scale * (position[i] - s.anchor_leader_position[i])
    apply(s.anchor_rotation_base_leader, moved, turned)
    for i in range(3):
        target_position[i] = s.anchor_tip_position[i] + turned[i]
    multiply_transposed(rotation, s.anchor_leader_rotation, first)
    multiply(s.anchor_rotation_base_leader, first, second)
    multiply_transposed(second, s.anchor_rotation_base_leader, first)
    multiply(first, s.anchor_tip_rotation, target_rotation)


@compiled
def limited_step(
    to_target: np.ndarray,
    distance: float,
    target_speed: float,
    velocity: np.ndarray,
    dt: float,
    speed: float,
    acceleration: float,
) -> None:
    """The next step of the desired pose toward its target, in place in ``to_target`` (3,).

    No faster than ``speed``; no faster than a stop at the target allows, the target itself moving
    at ``target_speed``; and no further from the last ``velocity`` (3,), which it replaces, than
    ``acceleration`` permits. The same for metres and for radians.
    """
    # The last step of a tick is included: without it every stop would pass its target by one.
    half = 0.5 * acceleration * dt
    stopping = math.sqrt(half * half + 2.0 * acceleration * distance) - half
    allowed = min(speed, target_speed + stopping)
    share = 1.0 if distance <= allowed * dt else allowed * dt / distance
    change = 0.0
    for i in range(3):
        to_target[i] *= share
        change += (to_target[i] / dt - velocity[i]) ** 2
    change = math.sqrt(change)
    if change > acceleration * dt:
        kept = acceleration * dt / change
        for i in range(3):
            to_target[i] = dt * (velocity[i] + kept * (to_target[i] / dt - velocity[i]))
    for i in range(3):
        velocity[i] = to_target[i] / dt


@compiled
def approach(
    s: RecordFields,
    target_position: np.ndarray,
    target_rotation: np.ndarray,
    dt: float,
    smoothing_s: float,
    p: RecordFields,
) -> None:
    """Move the desired pose toward the target: smoothed, limited in speed and acceleration.

    Args:
        s: the state that is changed.
        target_position: (3,) base frame, m.
        target_rotation: (3, 3) base frame.
        dt: s.
        smoothing_s: time constant over which coarse samples are interpolated; 0 for none.
        p: parameters with the limits.
    """
    share = 1.0 if smoothing_s <= 0.0 else 1.0 - math.exp(-dt / smoothing_s)
    step, vector, turn = np.empty(3), np.empty(3), np.empty((3, 3))
    distance = share * _distance(target_position, s.desired_position)
    moves = _distance(target_position, s.target_position) / dt
    for i in range(3):
        step[i] = share * (target_position[i] - s.desired_position[i])
    limited_step(step, distance, moves, s.desired_velocity, dt, p.speed_max, p.acceleration_max)
    if share == 1.0 and _distance(target_position, s.desired_position + step) < _ARRIVED_M:
        for i in range(3):
            s.desired_position[i] = target_position[i]
    else:
        for i in range(3):
            s.desired_position[i] += step[i]
    angle = share * rotation_error(target_rotation, s.desired_rotation, vector)
    turns = angle_between(target_rotation, s.target_rotation) / dt
    for i in range(3):
        vector[i] *= share
    velocity, limit = s.desired_angular_velocity, p.angular_acceleration_max
    limited_step(vector, angle, turns, velocity, dt, p.angular_speed_max, limit)
    exponential(vector, turn)
    turned = np.empty((3, 3))
    multiply(turn, s.desired_rotation, turned)
    orthonormalize(turned)
    arrived = share == 1.0 and angle_between(target_rotation, turned) < _ARRIVED_RAD
    for i in range(3):
        s.target_position[i] = target_position[i]
        for j in range(3):
            s.desired_rotation[i, j] = target_rotation[i, j] if arrived else turned[i, j]
            s.target_rotation[i, j] = target_rotation[i, j]


@compiled
def release(s: RecordFields) -> None:
    """Open the clutch: the desired pose is where the tip is, nothing is left to chase."""
    s.engaged = 0
    s.leader_kind = 0
    s.mode = 0
    expected_tip(s, s.desired_position, s.desired_rotation)
    for i in range(3):
        s.desired_velocity[i] = 0.0
        s.desired_angular_velocity[i] = 0.0
        s.target_position[i] = s.desired_position[i]
        for j in range(3):
            s.target_rotation[i, j] = s.desired_rotation[i, j]


@compiled
def _may_engage(
    outcome: np.ndarray,
    leader: RecordFields,
    settings: RecordFields,
    p: RecordFields,
    rotation: np.ndarray,
) -> bool:
    s = outcome[0].state
    if leader.absolute != 0:
        if leader.kind != _PATH and _distance(leader.position, s.tip_position) > p.target_distance:
            outcome[0].report.target_refused = _TOO_FAR
            return False
        return True
    if settings.alignment == _MATCHED:
        in_base = np.empty((3, 3))
        turn = np.empty((3, 3))
        _rotation_base_leader(leader, settings, turn)
        multiply(turn, rotation, in_base)
        if angle_between(in_base, s.tip_rotation) > p.alignment_tolerance:
            outcome[0].report.target_refused = _NOT_ALIGNED
            return False
    return True


@compiled
def _engage_or_check(
    outcome: np.ndarray,
    leader: RecordFields,
    settings: RecordFields,
    p: RecordFields,
    rotation: np.ndarray,
) -> bool:
    """Engage a leader that is new, or check an engaged one for a jump; False: it must not lead."""
    s = outcome[0].state
    if s.engaged == 0 or s.leader_kind != leader.kind:
        release(s)
        stale = leader.age_s > leader.timeout_s
        if stale or not _may_engage(outcome, leader, settings, p, rotation):
            return False
        s.engaged = 1
        s.leader_kind = leader.kind
        _anchor(s, leader, settings, rotation)
        return True
    if leader.absolute != 0 or leader.sequence == s.leader_sequence:
        return True
    jumped = _distance(leader.position, s.leader_position) > p.jump_position
    if jumped or angle_between(rotation, s.leader_rotation) > p.jump_angle:
        apply_event(outcome, _JUMP)
        release(s)
        return False
    return True


@compiled
def _keep_inside(
    outcome: np.ndarray, target: np.ndarray, trocar: np.ndarray, p: RecordFields
) -> None:
    """Bring a target (3,) back into the workspace, and under the body wall; note that it was out.

    A target that runs away from where it may be pulls the tip along the border, not beyond it. A
    tip that is outside already, as after a board or a trocar was changed, may stay where it is.
    """
    s = outcome[0].state
    for i in range(3):
        low = min(p.workspace_min[i], s.desired_position[i])
        high = max(p.workspace_max[i], s.desired_position[i])
        inside = min(max(target[i], low), high)
        if inside != target[i]:
            outcome[0].report.target_refused = _OUTSIDE
            target[i] = inside
    if s.leader_kind == _PATH:
        # A path is judged against itself; how far the shaft comes out is limited anyway.
        return
    height, here = 0.0, 0.0
    for i in range(3):
        height += (target[i] - trocar[i]) * p.wall_normal[i]
        here += (s.desired_position[i] - trocar[i]) * p.wall_normal[i]
    above = height - max(-_UNDER_WALL_M, here)
    if above > 0.0:
        outcome[0].report.target_refused = _BEHIND
        for i in range(3):
            target[i] -= above * p.wall_normal[i]


@compiled
def _chase(
    outcome: np.ndarray, tick_input: np.ndarray, rotation: np.ndarray, p: RecordFields
) -> None:
    """Find the target, lock what is locked, and move the desired pose toward it."""
    s = outcome[0].state
    leader = tick_input[0].leader
    settings = tick_input[0].settings
    target_position = np.empty(3)
    target_rotation = np.empty((3, 3))
    if leader.absolute != 0:
        target_position[:] = leader.position
        target_rotation[:] = rotation
    else:
        relative_target(s, leader.position, rotation, target_position, target_rotation)
    if settings.lock_translation != 0:
        target_position[:] = s.anchor_tip_position
    if settings.lock_rotation != 0:
        target_rotation[:] = s.anchor_tip_rotation
    _keep_inside(outcome, target_position, tick_input[0].trocar_position, p)
    approach(s, target_position, target_rotation, tick_input[0].dt_s, leader.smoothing_s, p)


@compiled
def follow(outcome: np.ndarray, tick_input: np.ndarray, parameters: np.ndarray) -> bool:
    """Update engagement and the desired pose in ``outcome``'s state.

    Args:
        outcome: (1,) record whose ``state`` is changed.
        tick_input: (1,) input record.
        parameters: (1,) parameters.

    Returns:
        Whether a leader is engaged, that is, whether the tip shall move.
    """
    s = outcome[0].state
    leader = tick_input[0].leader
    settings = tick_input[0].settings
    p = parameters[0]
    held = settings.hold_to_move == 0 or tick_input[0].hold != 0
    if not held and leader.clutch != 0 and s.safety == _ENABLED:
        outcome[0].report.target_refused = _NO_HOLD
    if s.safety != _ENABLED or not held or leader.kind == 0 or leader.clutch == 0:
        release(s)
        return False
    if not _valid(leader):
        apply_event(outcome, _INVALID)
        release(s)
        return False
    rotation = np.empty((3, 3))
    matrix_from_quaternion(leader.wxyz, rotation)
    if not _engage_or_check(outcome, leader, settings, p, rotation):
        return False
    if _settings_changed(s, leader, settings) or s.mode != leader.mode:
        _anchor(s, leader, settings, rotation)
    s.mode = leader.mode
    s.leader_sequence = leader.sequence
    for i in range(3):
        s.leader_position[i] = leader.position[i]
        for j in range(3):
            s.leader_rotation[i, j] = rotation[i, j]
    _chase(outcome, tick_input, rotation, p)
    return True
