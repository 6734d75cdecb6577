"""The second robot: two concentric-tube arms, A led by the operator, B keeping its place beside A.

``tick`` is a pure function of the state and the tick's input. It goes straight down: safety,
teleoperation, one iteration of the chosen method, kinematics.
"""

from __future__ import annotations

import numpy as np

from robot.compiled import compiled
from robot.concentric.control import REASONS, ControlReport, ControlStatus, PairControl
from robot.concentric.design import METHODS
from robot.concentric.kinematics import SOLVED
from robot.concentric.pair import ArmPair, PairKinematics, start_of
from robot.concentric.parameters import parameters
from robot.concentric.proximal import moving_bounds
from robot.concentric.records import concentric_types
from robot.concentric.tube_safety import decide
from robot.concentric.tubes import check_configuration
from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.records import LeaderKind, Safety
from robot.rotations import quaternion_from_matrix
from robot.safety import Event, apply_event
from robot.teleoperation import follow, release

ARMS = ("A", "B")

_LARGEST_SURPRISE = 0.1
"""How far the torsion may be from where its derivative says after a tick, rad/m: beyond that it is
that of another equilibrium, to which the tubes would have to snap."""


@compiled
def _wake(outcome: np.ndarray) -> None:
    """Nobody leads, and the desired pose is where the tip is."""
    release(outcome[0].state)


class UnsolvedStart(KeyholeError):
    """The tubes' torsion at the start has no solution that was found.

    Attributes:
        start: number of the start in the configuration.
    """

    code = "unsolved_start"

    def __init__(self, start: int) -> None:
        super().__init__(
            f"the tubes cannot be computed at start {start}; change [[concentric.starts]] or "
            "[concentric] start"
        )
        self.start = start


class ConcentricRobot:
    """Both arms as a pure robot: ``tick(state, input)`` fills an outcome.

    Attributes:
        configuration: what it was built from.
        parameters: (1,) its limits, compiled.
        types: of its records.
        pair: the model of both arms.
    """

    name = "concentric"

    def __init__(self, configuration: Configuration) -> None:
        """Build the model, every method, and the start.

        Raises:
            MeaninglessTubes: the model cannot describe the tubes.
            KeyholeError: the start is outside of (1), or cannot be computed.
        """
        design = configuration.concentric
        self.configuration = configuration
        self.parameters = parameters(configuration)
        self.types = concentric_types(len(design.tubes))
        period = 1.0 / design.rate_hz
        self._controls = tuple(
            PairControl(design, period, method, keeps_limits=True) for method in METHODS
        )
        self.pair: ArmPair = self._controls[0].pair
        tubes = self.pair.count
        self._now, self._after = PairKinematics(tubes), PairKinematics(tubes)
        self._report = ControlReport(tubes)
        self._feed_forward, self._guess = np.zeros(3), np.zeros(2 * tubes)
        self._least, self._largest = np.zeros(tubes), np.zeros(tubes)
        self._start = self._started()

    def _started(self) -> PairKinematics:
        design, tubes = self.configuration.concentric, self.pair.count
        found = PairKinematics(tubes)
        found.q[:] = start_of(design.starts[design.start - 1])
        for arm in range(2):
            check_configuration(found.q[2 * tubes * arm : 2 * tubes * (arm + 1)], self.pair.tubes)
        if self.pair.evaluate_cold(found) != SOLVED:
            raise UnsolvedStart(design.start)
        return found

    def initial_state(self) -> np.ndarray:
        """The (1,) state in which the robot wakes up: DISABLED at the configuration's start."""
        outcome = np.zeros(1, self.types.outcome)
        self._now.take(self._start)
        self._take(outcome, self._now)
        state = outcome["state"]
        state["relative_position"][0] = self._now.relative
        state["relative_allowance"] = self.parameters["relative_error"]
        _wake(outcome)
        return np.asarray(state.copy())

    def tick(self, state: np.ndarray, tick_input: np.ndarray, outcome: np.ndarray) -> None:
        """One step: decide, follow the leader, move both arms.

        Args:
            state: (1,) state of the last outcome; not changed.
            tick_input: (1,) input.
            outcome: (1,) outcome, filled: next state, command, report.
        """
        outcome.view(np.uint8)[:] = 0
        outcome["state"] = state
        outcome["state"]["tick"] += 1
        self._stand_at(state)
        self._report = ControlReport(self.pair.count)
        just_enabled = decide(outcome, tick_input, self.parameters)
        if just_enabled:
            self._take_measured(outcome, tick_input)
        engaged = follow(outcome, tick_input, self.parameters)
        is_enabled = outcome["state"]["safety"][0] == Safety.ENABLED
        if engaged and is_enabled and not just_enabled:
            self._move(outcome, tick_input)
        self._conclude(outcome, tick_input)

    def _stand_at(self, state: np.ndarray) -> None:
        """Kinematics where the state says that the arms stand, kept from the last tick if they are
        those: from its own torsion a configuration evaluates to the same bits again.
        """
        now, q, torsion = self._now, state["q"][0], state["torsion"][0]
        if now.q.tobytes() != q.tobytes() or now.torsion.tobytes() != torsion.tobytes():
            now.q[:] = q
            self.pair.evaluate(now, torsion)

    def _take_measured(self, outcome: np.ndarray, tick_input: np.ndarray) -> None:
        """Take the measured tubes as the commanded ones, and B's place beside A as it is."""
        after, now = self._after, self._now
        after.q[:] = tick_input["measured_q"][0]
        self.pair.guess_after(now, after.q, after.torsion)
        if self.pair.evaluate(after, after.torsion.copy()) != SOLVED:
            apply_event(outcome, int(Event.SOLVER_FAILED))
            return
        now.take(after)
        self._take(outcome, now)
        outcome["state"]["relative_position"][0] = now.relative

    def _move(self, outcome: np.ndarray, tick_input: np.ndarray) -> None:
        """One iteration of the chosen method toward the desired tip."""
        state = outcome["state"][0]
        control = self._controls[int(tick_input["settings"]["method"][0])]
        self._feed_forward[:] = state["desired_velocity"]
        # What was left over at the last tick is taken back; the desired tip's own way since is fed
        # forward.
        desired = state["desired_position"] - self._feed_forward * control.period
        status = control.step(
            self._now, desired, state["relative_position"], self._feed_forward,
            self._after, self._report,
        )  # fmt: skip
        if status == ControlStatus.SOLVED and self._snaps():
            self._report = ControlReport(self.pair.count)
            status = self._report.status = ControlStatus.UNSTABLE
        if status == ControlStatus.NOT_FINITE:
            apply_event(outcome, int(Event.SOLVER_FAILED))
        elif status in (ControlStatus.UNSTABLE, ControlStatus.NOT_CONVERGED):
            # Where the branch ends there is no solution near by; nothing has moved.
            apply_event(outcome, int(Event.NEAR_SNAPPING))
        if status == ControlStatus.SOLVED:
            rates = self._report.rates[: 2 * self.pair.count]
            outcome["report"]["twist"][0] = self._now.jacobian[0] @ rates
            self._now.take(self._after)
            self._take(outcome, self._now)
            outcome["command"]["moving"] = 1

    def _snaps(self) -> bool:
        """Whether the torsion after the step belongs to another equilibrium than the one before."""
        self.pair.guess_after(self._now, self._after.q, self._guess)
        return bool(np.abs(self._after.torsion - self._guess).max() > _LARGEST_SURPRISE)

    def _take(self, outcome: np.ndarray, kinematics: PairKinematics) -> None:
        """Let the state stand where ``kinematics`` says."""
        state = outcome["state"][0]
        state["q"], state["torsion"] = kinematics.q, kinematics.torsion
        state["tip_position"], state["position_b"] = kinematics.position
        state["tip_rotation"], state["rotation_b"] = kinematics.rotation

    def _conclude(self, outcome: np.ndarray, tick_input: np.ndarray) -> None:
        """Command and report that follow from the new state."""
        state, report = outcome["state"][0], outcome["report"][0]
        done, now, leader = self._report, self._now, tick_input["leader"][0]
        outcome["command"]["q"][0] = state["q"]
        report["q"], report["q_dot"] = state["q"], done.rates
        on_path = state["engaged"] and leader["kind"] == LeaderKind.PATH
        # The errors of a path are against the path, even where speed limits make the tip lag.
        report["desired_position"] = leader["position"] if on_path else state["desired_position"]
        quaternion_from_matrix(state["desired_rotation"], report["desired_wxyz"])
        report["commanded_position"], report["position_b"] = now.position
        quaternion_from_matrix(state["tip_rotation"], report["commanded_wxyz"])
        quaternion_from_matrix(state["rotation_b"], report["wxyz_b"])
        report["desired_b"] = now.position[0] + state["relative_position"]
        report["relative_error"] = np.linalg.norm(state["relative_position"] - now.relative)
        report["limits_active"], report["solver_status"] = done.limits_active, int(done.status)
        report["task_scale"], report["stability"] = done.scales, now.stability
        self._fill_bounds(report)

    def _fill_bounds(self, report: np.void) -> None:
        limits, n = self._controls[0].proximal, self.pair.count
        for arm in range(2):
            beta = self._now.q[2 * n * arm : 2 * n * arm + n]
            moving_bounds(
                beta, limits.lower, limits.upper, limits.gap_lower, limits.gap_upper,
                self._least, self._largest,
            )  # fmt: skip
            report["bound_lower"][n * arm : n * (arm + 1)] = self._least
            report["bound_upper"][n * arm : n * (arm + 1)] = self._largest


def describe_limits(bits: int, status: int, tubes: int) -> list[str]:
    """What holds the motion back, in words, for people.

    Args:
        bits: ``limits_active`` of the report.
        status: ``solver_status`` of the report, a ``ControlStatus``.
        tubes: tubes of an arm.
    """
    words = []
    kinds = ("at its fastest translation", "held by its end or a neighbour", "at its fastest turn")
    for kind, what in enumerate(kinds):
        words += [
            f"arm {ARMS[axis // tubes]}, tube {axis % tubes + 1} {what}"
            for axis in range(2 * tubes)
            if bits >> (2 * tubes * kind + axis) & 1
        ]
    if status not in (ControlStatus.SOLVED, ControlStatus.UNSTABLE):
        words.append(REASONS[ControlStatus(status)])
    return words
