"""The first robot: a 7-DoF arm that carries a tendon-driven continuum instrument.

``tick`` is a pure function of the state and the tick's input. It goes straight down: safety,
teleoperation, commands, priority, integration, kinematics.
"""

from __future__ import annotations

import math

import numpy as np

from robot.arm import Arm
from robot.commands import tip_twist
from robot.compiled import compiled
from robot.configuration import Configuration
from robot.instrument import project_on_shaft, rcm_jacobian, shaft, tip, tip_jacobian
from robot.parameters import parameters
from robot.priority.closed_form import augmented, polar_columns, prioritized
from robot.priority.levels import PRESETS, assemble, plan
from robot.priority.lexicographic import LexicographicProblem, error_damping
from robot.priority.limits import active_limits, rate_limits, share_within
from robot.records import OUTCOME, Case, Coordinates, Safety, Solver
from robot.rotations import angle_between, quaternion_from_matrix
from robot.safety import Event, apply_event, decide
from robot.segment import polar
from robot.start import start_configuration
from robot.teleoperation import follow
from robot.tendons import servo_angles
from robot.urdf import urdf_text

_ENABLED = int(Safety.ENABLED)
_SOLVER_FAILED = int(Event.SOLVER_FAILED)
_HQP, _AUGMENTED = int(Solver.HQP), int(Solver.AUGMENTED)
_BALANCED = int(Case.BALANCED)
_POLAR = int(Coordinates.POLAR)


class Work:
    """Memory that a tick writes over and never reads from the tick before."""

    def __init__(self) -> None:
        self.catalogue = np.zeros((10, 10))
        self.targets = np.zeros(10)
        self.preferred = np.zeros(10)
        self.previous_position = np.zeros(3)
        self.previous_rotation = np.zeros((3, 3))


@compiled
def _begin(
    state: np.ndarray,
    tick_input: np.ndarray,
    parameters: np.ndarray,
    outcome: np.ndarray,
    previous_position: np.ndarray,
    previous_rotation: np.ndarray,
) -> bool:
    """Copy the state, apply safety and teleoperation; True if the robot shall move."""
    source = state.view(np.float64)
    target = outcome.view(np.float64)
    for i in range(target.size):
        target[i] = 0.0
    for i in range(source.size):
        target[i] = source[i]
    s = outcome[0].state
    s.tick += 1
    for i in range(3):
        previous_position[i] = s.desired_position[i]
        for j in range(3):
            previous_rotation[i, j] = s.desired_rotation[i, j]
    just_enabled = decide(outcome, tick_input, parameters)
    engaged = follow(outcome, tick_input, parameters)
    if just_enabled or s.safety != _ENABLED:
        return False
    if engaged:
        return True
    speed = 0.0
    for i in range(3):
        speed += abs(tick_input[0].trocar_velocity[i])
    return speed > 0.0


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
) -> tuple[float, float]:
    """Fill the catalogue of task rows, their wanted rates, and the preferred rates.

    Returns the tip's position error (m) and orientation error (rad) left over from the last tick.
    """
    s = outcome[0].state
    i_ = tick_input[0]
    p = parameters[0]
    base = np.empty(3)
    end = np.empty(3)
    rotation = np.empty((3, 3))
    shaft(s.arm_position, s.arm_rotation, parameters, base, end, rotation)
    rcm_jacobian(s.arm_jacobian, base, end, s.x[9], catalogue[0:3])
    jacobian = np.empty((6, 10))
    tip_jacobian(
        s.arm_jacobian, rotation, s.tip_position, s.x[7], s.x[8], p.segment_length, jacobian
    )
    twist = outcome[0].report.twist
    tip_twist(
        s.desired_position,
        s.desired_rotation,
        previous_position,
        previous_rotation,
        s.tip_position,
        s.tip_rotation,
        i_.dt_s,
        i_.settings.feed_forward != 0 and s.engaged != 0,
        i_.settings.case == _BALANCED or i_.settings.solver == _AUGMENTED,
        parameters,
        twist,
    )
    gain = min(p.rcm_gain, 0.5 / i_.dt_s)
    for i in range(3):
        point = base[i] + s.x[9] * (end[i] - base[i])
        targets[i] = i_.trocar_velocity[i] + gain * (i_.trocar_position[i] - point)
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
    for k in range(10):
        catalogue[9, k] = 0.0
        preferred[k] = 0.0
    catalogue[9, 9] = 1.0
    targets[9] = p.lambda_gain * (i_.settings.lambda_reference - s.x[9])
    if s.engaged != 0:
        preferred[9] = targets[9]
        for k in range(7):
            reach = p.joint_upper[k] - p.joint_lower[k]
            middle = 0.5 * (p.joint_upper[k] + p.joint_lower[k])
            # Steepest descent of sum ((q - middle) / reach)^2 / 2, scaled to rad/s.
            preferred[k] = -p.posture_gain * (s.x[k] - middle) * (math.pi / reach) ** 2
    square = 0.0
    for i in range(3):
        square += (previous_position[i] - s.tip_position[i]) ** 2
    return math.sqrt(square), angle_between(previous_rotation, s.tip_rotation)


@compiled
def _prepare(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    parameters: np.ndarray,
    catalogue: np.ndarray,
    targets: np.ndarray,
    preferred: np.ndarray,
    rows: np.ndarray,
    weights: np.ndarray,
    starts: np.ndarray,
    matrix: np.ndarray,
    upper: np.ndarray,
    lower: np.ndarray,
    linear: np.ndarray,
) -> None:
    """Write the QP: bounds of the rates, the bend row, the equalised levels, the preference."""
    upper[10] = rate_limits(
        outcome[0].state.x, tick_input[0].dt_s, parameters, lower, upper, matrix[0]
    )
    assemble(catalogue, targets, rows, weights, starts, matrix[1:], upper[11:])
    for r in range(rows.size):
        lower[11 + r] = upper[11 + r]
    for k in range(10):
        linear[k] = -preferred[k]


@compiled
def _integrate(
    outcome: np.ndarray,
    dt: float,
    rates: np.ndarray,
    catalogue: np.ndarray,
    targets: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    bend_row: np.ndarray,
    bend_bound: float,
    parameters: np.ndarray,
) -> None:
    """Move x by the rates and note what the levels and limits left over."""
    s = outcome[0].state
    report = outcome[0].report
    for k in range(10):
        # The solver keeps the box to its tolerance only; this takes out no more than that.
        rates[k] = min(max(rates[k], lower[k]), upper[k])
    report.limits_active = active_limits(
        s.x, rates, lower, upper, bend_row, bend_bound, parameters
    )
    residual = np.zeros(3)
    for level in range(3):
        for i in range(3 * level, 3 * level + 3):
            achieved = 0.0
            for k in range(10):
                achieved += catalogue[i, k] * rates[k]
            residual[level] += (targets[i] - achieved) ** 2
    report.residual_rcm = math.sqrt(residual[0])
    report.residual_linear = math.sqrt(residual[1])
    report.residual_angular = math.sqrt(residual[2])
    for k in range(10):
        report.x_dot[k] = rates[k]
        s.x[k] += dt * rates[k]
    outcome[0].command.moving = 1


@compiled
def _conclude(
    outcome: np.ndarray,
    arm_position: np.ndarray,
    arm_rotation: np.ndarray,
    arm_jacobian: np.ndarray,
    trocar: np.ndarray,
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
    base = np.empty(3)
    end = np.empty(3)
    rotation = np.empty((3, 3))
    shaft(s.arm_position, s.arm_rotation, parameters, base, end, rotation)
    tip(end, rotation, s.x[7], s.x[8], p.segment_length, s.tip_position, s.tip_rotation)
    if s.engaged == 0:
        if outcome[0].command.moving == 0:
            s.x[9] = project_on_shaft(trocar, base, end)[0]
            s.desired_position[:] = s.tip_position
            s.desired_rotation[:] = s.tip_rotation
    command = outcome[0].command
    servo_angles(s.x[7], s.x[8], p.pitch_radius, p.pulley_radius, command.servo)
    report = outcome[0].report
    for i in range(7):
        command.q[i] = s.x[i]
    report.x[:] = s.x
    report.theta, report.delta = polar(s.x[7], s.x[8])
    report.desired_position[:] = s.desired_position
    report.commanded_position[:] = s.tip_position
    quaternion_from_matrix(s.desired_rotation, report.desired_wxyz)
    quaternion_from_matrix(s.tip_rotation, report.commanded_wxyz)


class InstrumentRobot:
    """The instrument as a pure robot: ``tick(state, input)`` fills an outcome.

    Attributes:
        configuration: what it was built from.
        parameters: (1,) the same, compiled.
    """

    name = "instrument"

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self.parameters = parameters(configuration)
        self._arm = Arm(urdf_text(configuration))
        self._work = Work()
        length = configuration.priority.characteristic_length_m
        self._problems = tuple(
            LexicographicProblem(plan(PRESETS[case], length)) for case in Case
        )
        self._start = start_configuration(configuration, self._arm, self.parameters)

    def initial_state(self, x: np.ndarray | None = None) -> np.ndarray:
        """The (1,) state in which the robot wakes up: DISABLED at the start, or at ``x`` (10,)."""
        outcome = np.zeros(1, OUTCOME)
        state = outcome["state"]
        state["x"] = self._start if x is None else x
        trocar = np.array(self.configuration.trocar.position_m)
        self._arm.update(state["x"][0, :7])
        self._conclude(outcome, trocar)
        return np.asarray(outcome["state"].copy())

    def _conclude(self, outcome: np.ndarray, trocar: np.ndarray) -> None:
        arm = self._arm
        _conclude(outcome, arm.position, arm.rotation, arm.jacobian, trocar, self.parameters)

    def tick(self, state: np.ndarray, tick_input: np.ndarray, outcome: np.ndarray) -> None:
        """One step: decide, command, solve, integrate.

        Args:
            state: (1,) ``STATE`` of the last outcome; not changed.
            tick_input: (1,) ``INPUT``.
            outcome: (1,) ``OUTCOME``, filled: next state, command, report.
        """
        work = self._work
        moving = _begin(
            state,
            tick_input,
            self.parameters,
            outcome,
            work.previous_position,
            work.previous_rotation,
        )
        if moving:
            self._move(tick_input, outcome)
        # A view into the record costs more than the kinematics; x has its own buffer.
        self._arm.update(outcome["state"]["x"][0, :7])
        self._conclude(outcome, tick_input["trocar_position"][0])

    def _move(self, tick_input: np.ndarray, outcome: np.ndarray) -> None:
        work = self._work
        distance, angle = _tasks(
            outcome,
            tick_input,
            self.parameters,
            work.previous_position,
            work.previous_rotation,
            work.catalogue,
            work.targets,
            work.preferred,
        )
        settings = tick_input["settings"][0]
        problem = self._problems[settings["case"]]
        _prepare(
            outcome,
            tick_input,
            self.parameters,
            work.catalogue,
            work.targets,
            work.preferred,
            problem.plan.rows,
            problem.plan.weights,
            problem.plan.starts,
            problem.matrix,
            problem.upper,
            problem.lower,
            problem.preferred,
        )
        if settings["solver"] == _HQP:
            rates, flag = problem.solve(error_damping(distance, angle))
        else:
            rates, flag = self._closed_form(settings, problem, outcome), 1
        if flag <= 0 or not np.isfinite(rates).all():
            apply_event(outcome, _SOLVER_FAILED)
            outcome["report"]["solver_status"] = flag if flag <= 0 else -100
            return
        _integrate(
            outcome,
            tick_input["dt_s"][0],
            rates,
            work.catalogue,
            work.targets,
            problem.lower,
            problem.upper,
            problem.matrix[0],
            problem.upper[10],
            self.parameters,
        )

    def _closed_form(
        self, settings: np.void, problem: LexicographicProblem, outcome: np.ndarray
    ) -> np.ndarray:
        work = self._work
        x = outcome["state"]["x"][0]
        change = polar_columns(x[7], x[8]) if settings["coordinates"] == _POLAR else np.eye(10)
        catalogue = work.catalogue @ change
        preferred = work.preferred.copy()
        if settings["coordinates"] == _POLAR:
            preferred[7:9] = 0.0
        if settings["solver"] == _AUGMENTED:
            rates = augmented(catalogue, work.targets, preferred)
        else:
            rates = prioritized(problem.plan, catalogue, work.targets, preferred)
        rates = change @ rates
        share = share_within(
            rates, problem.lower, problem.upper, problem.matrix[0], float(problem.upper[10])
        )
        return np.asarray(share * rates)

