"""The first robot: a 7-DoF arm that carries a tendon-driven continuum instrument.

``tick`` is a pure function of the state and the tick's input. It goes straight down: safety,
teleoperation, commands, priority, integration, kinematics, tendons, sensing.
"""

from __future__ import annotations

import numpy as np

from robot.arm import Arm
from robot.calibration import Calibration
from robot.clearance import measure_clearance
from robot.configuration import Configuration
from robot.instrument import shaft
from robot.instrument_tick import (
    SOLVE_CLOSED_FORM,
    SOLVE_QP,
    conclude,
    copy_joints,
    decide_and_prepare,
    integrate,
    wake,
)
from robot.parameters import parameters
from robot.priority.closed_form import augmented, polar_columns, prioritized
from robot.priority.levels import PRESETS, Plan, plan
from robot.priority.lexicographic import LexicographicProblem, error_damping
from robot.priority.limits import share_within
from robot.records import ARM_JOINTS, INPUT, OUTCOME, Case, Coordinates, Solver
from robot.sensing.joint_estimate import ESTIMATE, SAMPLE
from robot.sensing.parameters import estimator_parameters
from robot.sensing.sense import say_off, sense, sensing_is_on
from robot.start import start_configuration
from robot.tension.distribution import nearest_bounded, solve_bounded
from robot.tension.tendon_command import finish_tendons, prepare_tendons
from robot.urdf import urdf_text


def _padded(plans: tuple[Plan, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The presets as arrays, so that the compiled tick picks one by its number.

    Returns:
        Rows and levels (cases, 2), catalogue rows (cases, 10), weights (cases, 10), first row of
        each level (cases, 11).
    """
    count = len(plans)
    sizes, rows = np.zeros((count, 2), dtype=np.int64), np.zeros((count, 10), dtype=np.int64)
    weights, starts = np.zeros((count, 10)), np.zeros((count, 11), dtype=np.int64)
    for index, one in enumerate(plans):
        used, levels = len(one.rows), len(one.starts) - 1
        sizes[index] = used, levels
        rows[index, :used] = one.rows
        weights[index, :used] = one.weights
        starts[index, : levels + 1] = one.starts
    return sizes, rows, weights, starts


class _Work:
    """Memory that a tick writes over and never reads from the tick before."""

    def __init__(self) -> None:
        self.catalogue = np.zeros((10, 10))
        self.targets = np.zeros(10)
        self.preferred = np.zeros(10)
        self.matrix = np.zeros((11, 10))
        self.upper = np.zeros(21)
        self.lower = np.full(21, -1e30)
        self.left_over = np.zeros(2)
        self.q = np.zeros(7)
        self.measured_q = np.zeros(7)
        self.joints = np.zeros((8, 3))
        self.flange = np.zeros((3, 3))
        self.shaft_base, self.shaft_end = np.zeros(3), np.zeros(3)
        self.shaft_rotation = np.zeros((3, 3))
        self.rows, self.right = np.zeros((2, 4)), np.zeros(2)
        self.least, self.none = np.zeros(4), np.zeros(4)
        self.sample, self.found = np.zeros(1, SAMPLE), np.zeros(1, ESTIMATE)


class InstrumentRobot:
    """The instrument as a pure robot: ``tick(state, input)`` fills an outcome.

    Attributes:
        configuration: what it was built from.
        calibration: of its tendons.
        parameters: (1,) the same, compiled.
    """

    name = "instrument"

    def __init__(
        self, configuration: Configuration, calibration: Calibration | None = None
    ) -> None:
        """Build the models and find the start; raises ``UnreachableStart``.

        Args:
            configuration: describes the robot.
            calibration: of its tendons; without one they are taken as ideal.
        """
        self.configuration = configuration
        self.calibration = calibration or Calibration()
        self.parameters = parameters(configuration, calibration)
        self._model, self._sensing = estimator_parameters(configuration, self.calibration)
        self._arm = Arm(urdf_text(configuration))
        self._work = _Work()
        length = configuration.priority.characteristic_length_m
        plans = tuple(plan(PRESETS[case], length) for case in Case)
        self._plans = _padded(plans)
        self._problems = tuple(
            LexicographicProblem(one, self._work.matrix, self._work.upper, self._work.lower)
            for one in plans
        )
        self._most = np.full(4, self.parameters["tension_limit"][0])
        self._start = start_configuration(configuration, self._arm, self.parameters)

    def initial_state(self, x: np.ndarray | None = None) -> np.ndarray:
        """The (1,) state in which the robot wakes up: DISABLED at the start, or at ``x`` (10,)."""
        outcome, tick_input = np.zeros(1, OUTCOME), np.zeros(1, INPUT)
        outcome["state"]["x"] = self._start if x is None else x
        tick_input["measured_q"] = outcome["state"]["x"][:, :7]
        tick_input["trocar_position"] = self.configuration.trocar.position_m
        self._conclude(outcome, tick_input)
        wake(outcome, self.parameters)
        return np.asarray(outcome["state"].copy())

    def tick(self, state: np.ndarray, tick_input: np.ndarray, outcome: np.ndarray) -> None:
        """One step: decide, command, solve, integrate.

        Args:
            state: (1,) ``STATE`` of the last outcome; not changed.
            tick_input: (1,) ``INPUT``.
            outcome: (1,) ``OUTCOME``, filled: next state, command, report.
        """
        work = self._work
        left = decide_and_prepare(
            state,
            tick_input,
            self.parameters,
            outcome,
            self._plans,
            work.catalogue,
            work.targets,
            work.preferred,
            work.matrix,
            work.upper,
            work.lower,
            work.left_over,
        )
        if left >= SOLVE_CLOSED_FORM:
            rates = self._closed_form(left - SOLVE_CLOSED_FORM, tick_input, outcome)
            self._integrate(tick_input, outcome, 1, rates)
        elif left >= SOLVE_QP:
            damping = error_damping(work.left_over[0], work.left_over[1])
            rates, status = self._problems[left].solve(work.preferred, damping)
            self._integrate(tick_input, outcome, status, rates)
        self._conclude(outcome, tick_input)
        self._tend(outcome, tick_input)
        self._sense(outcome, tick_input)

    def _integrate(
        self, tick_input: np.ndarray, outcome: np.ndarray, status: int, rates: np.ndarray
    ) -> None:
        work = self._work
        integrate(
            outcome,
            tick_input,
            status,
            rates,
            work.catalogue,
            work.targets,
            work.lower,
            work.upper,
            work.matrix[0],
            self.parameters,
        )

    def _conclude(self, outcome: np.ndarray, tick_input: np.ndarray) -> None:
        arm, work = self._arm, self._work
        measures = copy_joints(outcome, tick_input, work.q, work.measured_q)
        arm.update(work.q)
        conclude(outcome, tick_input, arm.position, arm.rotation, arm.jacobian, self.parameters)
        if measures:
            arm.place(work.measured_q, work.joints, work.flange)
            measure_clearance(outcome, tick_input, work.joints, work.flange, self.parameters)

    def _tend(self, outcome: np.ndarray, tick_input: np.ndarray) -> None:
        work, p = self._work, self.parameters
        rows, right, least = work.rows, work.right, work.least
        if not prepare_tendons(outcome, tick_input, p, rows, right, least):
            return
        wanted = solve_bounded(rows, right, work.none, least, self._most)
        if wanted is None:
            wanted = nearest_bounded(rows, right, least, self._most)
        finish_tendons(outcome, tick_input, p, wanted, rows, right)

    def _sense(self, outcome: np.ndarray, tick_input: np.ndarray) -> None:
        work, arm = self._work, self._arm
        if not sensing_is_on(tick_input):
            say_off(outcome)
            return
        arm.place(work.measured_q, work.joints, work.flange)
        shaft(
            work.joints[ARM_JOINTS],
            work.flange,
            self.parameters,
            work.shaft_base,
            work.shaft_end,
            work.shaft_rotation,
        )
        sense(
            outcome,
            tick_input,
            work.shaft_end,
            work.shaft_rotation,
            self.parameters,
            self._model,
            self._sensing,
            work.sample,
            work.found,
        )

    def _closed_form(self, case: int, tick_input: np.ndarray, outcome: np.ndarray) -> np.ndarray:
        work, settings = self._work, tick_input["settings"][0]
        x = outcome["state"]["x"][0]
        polar = settings["coordinates"] == Coordinates.POLAR
        change = polar_columns(x[7], x[8]) if polar else np.eye(10)
        catalogue = work.catalogue @ change
        if settings["solver"] == Solver.AUGMENTED:
            rates = augmented(catalogue, work.targets, work.preferred)
        else:
            rates = prioritized(self._problems[case].plan, catalogue, work.targets, work.preferred)
        rates = change @ rates
        return np.asarray(
            rates * share_within(rates, work.lower, work.upper, work.matrix[0], work.upper[10])
        )
