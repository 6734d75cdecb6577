"""The compiled stages of the instrument's tick, in the order in which they run."""

from __future__ import annotations

import math

import numpy as np

from robot.clearance import EVERY_TICKS
from robot.commands import tip_twist
from robot.compensation import SHARE_RATE, commanded_bend, follow_friction, follow_setting
from robot.compiled import compiled
from robot.instrument import project_on_shaft, rcm_jacobian, shaft, tip, tip_jacobian
from robot.instrument_safety import decide
from robot.priority.levels import assemble
from robot.priority.limits import active_limits, lock_arm, lock_segment, rate_limits
from robot.priority.meet_all import meet_all
from robot.records import Case, DriveMode, LeaderKind, Safety, Solver
from robot.rotations import angle_between, quaternion_from_matrix
from robot.safety import Event, apply_event
from robot.segment import polar
from robot.sensing.tip_correction import aim, correct, expected_tip, follow_tip, start_correction
from robot.teleoperation import follow
from robot.tendons import servo_angles

DONE, SOLVE_QP, SOLVE_CLOSED_FORM = -1, 0, 100
"""What :func:`decide_and_prepare` left to do: nothing, or to solve; the case is added to these."""

NOT_FINITE = -100
"""Solver status when the problem or the rates hold NaN or infinity."""

_ENABLED = int(Safety.ENABLED)
_HQP, _AUGMENTED = int(Solver.HQP), int(Solver.AUGMENTED)
_SOLVER_FAILED = int(Event.SOLVER_FAILED)
_PATH = int(LeaderKind.PATH)
_ARM, _SEGMENT = int(DriveMode.ARM), int(DriveMode.SEGMENT)
_BALANCED = int(Case.BALANCED)
_CORRECTIONS_PER_TICK = 0.5
"""Largest share of the deviation at the trocar that one tick takes back."""


@compiled
def _begin(state: np.ndarray, outcome: np.ndarray) -> None:
    """Copy the state into the outcome, clear command and report."""
    source = state.view(np.float64)
    target = outcome.view(np.float64)
    for i in range(source.size):
        target[i] = source[i]
    for i in range(source.size, target.size):
        target[i] = 0.0
    outcome[0].state.tick += 1


@compiled
def _rcm_rows(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    parameters: np.ndarray,
    base: np.ndarray,
    end: np.ndarray,
    catalogue: np.ndarray,
    targets: np.ndarray,
) -> None:
    """The shaft's point at lambda follows the trocar, and what it is off is taken back."""
    s = outcome[0].state
    i_ = tick_input[0]
    rcm_jacobian(s.arm_jacobian, base, end, s.x[9], catalogue[0:3])
    gain = min(parameters[0].rcm_gain, _CORRECTIONS_PER_TICK / i_.dt_s)
    for i in range(3):
        point = base[i] + s.x[9] * (end[i] - base[i])
        targets[i] = i_.trocar_velocity[i] + gain * (i_.trocar_position[i] - point)


@compiled
def _tip_rows(
    outcome: np.ndarray, jacobian: np.ndarray, catalogue: np.ndarray, targets: np.ndarray
) -> None:
    """Linear rows in the base frame, angular rows in the tip frame."""
    s = outcome[0].state
    twist = outcome[0].report.twist
    for i in range(3):
        targets[3 + i] = twist[i]
        targets[6 + i] = 0.0
        for j in range(3):
            targets[6 + i] += s.tip_rotation[j, i] * twist[3 + j]
        for k in range(10):
            catalogue[3 + i, k] = jacobian[i, k]
            angular = 0.0
            for j in range(3):
                angular += s.tip_rotation[j, i] * jacobian[3 + j, k]
            catalogue[6 + i, k] = angular


@compiled
def _preferences(
    outcome: np.ndarray,
    lambda_reference: float,
    parameters: np.ndarray,
    catalogue: np.ndarray,
    targets: np.ndarray,
    preferred: np.ndarray,
) -> None:
    """The lambda row, and what the freedom that is left is used for: posture, and lambda.

    eq. (73) with the sign that draws lambda to its reference; the posture descends
    sum((q - middle) / reach)^2, away from the joint limits.
    """
    s = outcome[0].state
    p = parameters[0]
    for k in range(10):
        catalogue[9, k] = 0.0
        preferred[k] = 0.0
    catalogue[9, 9] = 1.0
    targets[9] = p.lambda_gain * (lambda_reference - s.x[9])
    if s.engaged == 0:
        return
    preferred[9] = targets[9]
    for k in range(7):
        reach = p.joint_upper[k] - p.joint_lower[k]
        middle = 0.5 * (p.joint_upper[k] + p.joint_lower[k])
        preferred[k] = -p.posture_gain * (s.x[k] - middle) * (math.pi / reach) ** 2


@compiled
def _tasks(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    parameters: np.ndarray,
    previous_position: np.ndarray,
    previous_rotation: np.ndarray,
    catalogue: np.ndarray,
    targets: np.ndarray,
    preferred: np.ndarray,
) -> None:
    """Fill the catalogue of task rows, their wanted rates, and the preferred rates."""
    s = outcome[0].state
    settings = tick_input[0].settings
    base, end, rotation = np.empty(3), np.empty(3), np.empty((3, 3))
    shaft(s.arm_position, s.arm_rotation, parameters, base, end, rotation)
    _rcm_rows(outcome, tick_input, parameters, base, end, catalogue, targets)
    position, turned = np.empty(3), np.empty((3, 3))
    aim(s, s.desired_position, s.desired_rotation, position, turned)
    tip_twist(
        position,
        turned,
        previous_position,
        previous_rotation,
        s.tip_position,
        s.tip_rotation,
        tick_input[0].dt_s,
        settings.feed_forward != 0 and s.engaged != 0,
        settings.case == _BALANCED or settings.solver == _AUGMENTED,
        parameters,
        outcome[0].report.twist,
    )
    jacobian = np.empty((6, 10))
    length = parameters[0].segment_length
    tip_jacobian(s.arm_jacobian, rotation, s.tip_position, s.x[7], s.x[8], length, jacobian)
    _tip_rows(outcome, jacobian, catalogue, targets)
    _preferences(outcome, settings.lambda_reference, parameters, catalogue, targets, preferred)


@compiled
def integrate(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    status: int,
    rates: np.ndarray,
    catalogue: np.ndarray,
    targets: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    bend_row: np.ndarray,
    parameters: np.ndarray,
) -> None:
    """Move x by ``rates`` (10,) and note what levels and limits left over.

    A solver that failed (``status`` <= 0) or rates that are not finite move nothing: FAULT.
    """
    s = outcome[0].state
    report = outcome[0].report
    dt = tick_input[0].dt_s
    for k in range(10):
        if not math.isfinite(rates[k]):
            status = NOT_FINITE
    report.solver_status = status
    if status <= 0:
        apply_event(outcome, _SOLVER_FAILED)
        return
    for k in range(10):
        # The solver keeps the box to its tolerance only; this takes out no more than that.
        rates[k] = min(max(rates[k], lower[k]), upper[k])
    report.limits_active = active_limits(s.x, rates, lower, upper, bend_row, upper[10], parameters)
    residual = np.zeros(3)
    for row in range(9):
        left = targets[row]
        for k in range(10):
            left -= catalogue[row, k] * rates[k]
        residual[row // 3] += left * left
    report.residual_rcm = math.sqrt(residual[0])
    report.residual_linear = math.sqrt(residual[1])
    report.residual_angular = math.sqrt(residual[2])
    u, v = s.x[7], s.x[8]
    for k in range(10):
        report.x_dot[k] = rates[k]
        s.x[k] += dt * rates[k]
    follow_friction(s, u, v, parameters)
    follow_setting(s, tick_input[0].settings.compensation, SHARE_RATE * dt)
    outcome[0].command.moving = 1


@compiled
def _trocar_moves(tick_input: np.ndarray) -> bool:
    velocity = tick_input[0].trocar_velocity
    return bool(velocity[0] != 0.0 or velocity[1] != 0.0 or velocity[2] != 0.0)


@compiled
def _numbers(dt: float, targets: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> bool:
    """Whether the problem is made of numbers. A solver may take a NaN for a bound that is not there
    and answer with finite rates that ignore the trocar.
    """
    total = 1.0 / dt + dt
    for k in range(10):
        total += abs(targets[k]) + abs(lower[k]) + abs(upper[k])
    return math.isfinite(total)


@compiled
def _levels_and_limits(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    parameters: np.ndarray,
    plans: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    catalogue: np.ndarray,
    targets: np.ndarray,
    matrix: np.ndarray,
    upper: np.ndarray,
    lower: np.ndarray,
) -> int:
    """Write the bounds of the rates, the bend row, the case's levels; how many rows these have."""
    sizes, rows, weights, starts = plans
    case = tick_input[0].settings.case
    count, levels = sizes[case, 0], sizes[case, 1]
    x, dt = outcome[0].state.x, tick_input[0].dt_s
    upper[10] = rate_limits(x, dt, parameters, lower, upper, matrix[0])
    mode = outcome[0].state.mode
    if tick_input[0].settings.lock_arm != 0 or mode == _SEGMENT:
        lock_arm(lower, upper)
    if mode == _ARM:
        lock_segment(lower, upper)
    assemble(
        catalogue,
        targets,
        rows[case, :count],
        weights[case, :count],
        starts[case, : levels + 1],
        matrix[1:],
        upper[11:],
    )
    for row in range(11, 11 + count):
        lower[row] = upper[row]
    return int(count)


@compiled
def decide_and_prepare(
    state: np.ndarray,
    tick_input: np.ndarray,
    parameters: np.ndarray,
    outcome: np.ndarray,
    plans: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    catalogue: np.ndarray,
    targets: np.ndarray,
    preferred: np.ndarray,
    matrix: np.ndarray,
    upper: np.ndarray,
    lower: np.ndarray,
    left_over: np.ndarray,
) -> int:
    """Safety, teleoperation, commands, levels and limits; and the motion, where all can be met.

    Args:
        state: (1,) the last outcome's state.
        tick_input: (1,).
        parameters: (1,).
        outcome: (1,) filled.
        plans: of each preset, rows and levels (cases, 2); catalogue rows (cases, 10); their
            weights (cases, 10); first row of each level (cases, 11).
        catalogue: (10, 10) filled with the task rows.
        targets: (10,) filled with their wanted rates.
        preferred: (10,) filled with the preferred rates.
        matrix: (11, 10) filled: the bend row, then the plan's rows.
        upper: (21,) filled: of the rates, the bend row, the plan's rows.
        lower: (21,) filled likewise.
        left_over: (2,) filled: position error (m) and orientation error (rad) of the last tick.

    Returns:
        ``DONE``, or the case plus ``SOLVE_QP`` or ``SOLVE_CLOSED_FORM``.
    """
    _begin(state, outcome)
    s = outcome[0].state
    i_ = tick_input[0]
    position, rotation = np.empty(3), np.empty((3, 3))
    use_tracker = i_.settings.use_tracker != 0
    correct(s, i_.tracker, use_tracker, i_.dt_s, parameters)
    aim(s, s.desired_position, s.desired_rotation, position, rotation)
    just_enabled = decide(outcome, tick_input, parameters)
    engaged = follow(outcome, tick_input, parameters)
    if just_enabled or s.safety != _ENABLED:
        return DONE
    if not engaged and not _trocar_moves(tick_input):
        return DONE
    _tasks(outcome, tick_input, parameters, position, rotation, catalogue, targets, preferred)
    square = 0.0
    for k in range(3):
        square += (position[k] - s.tip_position[k]) ** 2
    left_over[0] = math.sqrt(square)
    left_over[1] = angle_between(rotation, s.tip_rotation)
    rows = _levels_and_limits(
        outcome, tick_input, parameters, plans, catalogue, targets, matrix, upper, lower
    )
    if not _numbers(i_.dt_s, targets, lower, upper):
        outcome[0].report.solver_status = NOT_FINITE
        apply_event(outcome, _SOLVER_FAILED)
        return DONE
    if i_.settings.solver != _HQP:
        return SOLVE_CLOSED_FORM + int(i_.settings.case)
    rates = np.empty(10)
    levels_matrix, levels_target = matrix[1 : 1 + rows], upper[11 : 11 + rows]
    if not meet_all(levels_matrix, levels_target, preferred, lower, upper, matrix[0], rates):
        return SOLVE_QP + int(i_.settings.case)
    integrate(
        outcome, tick_input, 1, rates, catalogue, targets, lower, upper, matrix[0], parameters
    )
    return DONE


@compiled
def conclude(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    arm_position: np.ndarray,
    arm_rotation: np.ndarray,
    arm_jacobian: np.ndarray,
    parameters: np.ndarray,
) -> None:
    """Forward kinematics of the new x into the state, and the command and report that follow."""
    s = outcome[0].state
    p = parameters[0]
    for i in range(3):
        s.arm_position[i] = arm_position[i]
        for j in range(3):
            s.arm_rotation[i, j] = arm_rotation[i, j]
    for i in range(6):
        for j in range(7):
            s.arm_jacobian[i, j] = arm_jacobian[i, j]
    base, end, rotation = np.empty(3), np.empty(3), np.empty((3, 3))
    shaft(s.arm_position, s.arm_rotation, parameters, base, end, rotation)
    tip(end, rotation, s.x[7], s.x[8], p.segment_length, s.tip_position, s.tip_rotation)
    command, report = outcome[0].command, outcome[0].report
    if s.engaged == 0 and command.moving == 0:
        s.x[9] = project_on_shaft(tick_input[0].trocar_position, base, end)[0]
        expected_tip(s, s.desired_position, s.desired_rotation)
    follow_tip(s, tick_input[0].dt_s, p.tracker_delay)
    for i in range(7):
        command.q[i] = s.x[i]
    told = np.empty(2)
    commanded_bend(s, parameters, told)
    servo_angles(told[0], told[1], p.pitch_radius, p.pulley_radius, command.servo)
    report.x[:] = s.x
    report.theta, report.delta = polar(s.x[7], s.x[8])
    leader = tick_input[0].leader
    if s.engaged != 0 and leader.kind == _PATH:
        # The errors of a path are against the path, even where speed limits make the tip lag.
        report.desired_position[:] = leader.position
        report.desired_wxyz[:] = leader.wxyz
    else:
        report.desired_position[:] = s.desired_position
        quaternion_from_matrix(s.desired_rotation, report.desired_wxyz)
    report.commanded_position[:] = s.tip_position
    quaternion_from_matrix(s.tip_rotation, report.commanded_wxyz)


@compiled
def wake(outcome: np.ndarray, parameters: np.ndarray) -> None:
    """What the state remembers when the robot wakes up: where the servos are, else nothing."""
    s = outcome[0].state
    for i in range(4):
        s.tendon_servo[i] = outcome[0].command.servo[i]
    start_correction(s)
    s.contact_allowance = parameters[0].contact_force
    s.clearance_allowance = parameters[0].clearance


@compiled
def copy_joints(
    outcome: np.ndarray, tick_input: np.ndarray, q: np.ndarray, measured_q: np.ndarray
) -> bool:
    """Copy the commanded and the measured joint angles (7,): cheaper than views into the records.

    Returns:
        Whether clearances are to be measured in this tick.
    """
    total = 0.0
    for i in range(7):
        q[i] = outcome[0].state.x[i]
        measured_q[i] = tick_input[0].measured_q[i]
        total += measured_q[i]
    return bool(outcome[0].state.tick % EVERY_TICKS == 0 and math.isfinite(total))
