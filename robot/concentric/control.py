"""One iteration of the two arms' control: A to where it shall be, B keeping its place beside A.

Paper 2 (Alsaka, Cinquin & Chikhaoui 2024), section 2: v_AB = λ_AB ε_AB, v_A = λ_A ε_A + ẋ_A, and a
method that turns both into rates. Errors are desired minus actual. The experiments (T = 0.1 s) and
the console (T = 0.01 s) run this same step. Nothing here raises once it is built.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from robot.compiled import compiled
from robot.concentric.design import Concentric
from robot.concentric.kinematics import SOLVED
from robot.concentric.methods.choice import Method, method_named
from robot.concentric.methods.rate_problem import RateProblem, Solution
from robot.concentric.pair import ArmPair, PairKinematics
from robot.concentric.proximal import Proximal, settle_inside
from robot.concentric.rate_limits import limits_active, share_within
from robot.concentric.stability_slope import stability_slope

CORRECTIONS = 3
"""How often a step that curvature bends away is linearised anew, by methods that do so."""
SHARES = 5
"""How many shares of such a step are tried, each half of the one before."""
RELATIVE_CLOSE = 2e-6
"""Relative error that a step may add without another correction, m."""
RELATIVE_ALLOWED = 2e-5
"""Relative error beyond which a step is halved, m."""
DAMPING_PER_STEP, DAMPING_MAX = 600.0, 1.0
"""Damping of hqp's levels for each metre that A is asked to go in an iteration, and its largest."""
STABILITY_NEAR = 0.4
"""Stability determinant below which hqp watches how it falls."""
STABILITY_KEPT = 1.2
"""How many times the margin the determinant is kept at; the line of its slope lies above it."""
_STABILITY_SHARE = 0.5
"""How much of what is left to that may fall in an iteration."""
_MOVING = 1e-4
"""Step of A, m, from which on a determinant below what is kept has to rise."""
RELATIVE_LOOSE = 5e-5
"""Relative error that a step may leave, m, where no share of it leaves less: where a curved part
begins at a tube's end the Jacobian jumps, and no correction holds on both sides."""
_LENGTH_TOLERANCE = 1e-12


class ControlStatus(IntEnum):
    """What became of an iteration; nothing moves unless it is ``SOLVED``."""

    SOLVED = 0
    INFEASIBLE = 1
    NOT_CONVERGED = 2
    NOT_FINITE = 3
    UNSTABLE = 4
    SOLVER_FAILED = 5
    DRIFTING = 6
    OUT_OF_REACH = 7


_NOT_CONVERGED = ControlStatus.NOT_CONVERGED

REASONS: dict[ControlStatus, str] = {
    ControlStatus.SOLVED: "moved",
    ControlStatus.INFEASIBLE: "no rates keep both the relative position and the limits",
    ControlStatus.NOT_CONVERGED: "the tubes' torsion has no solution near by",
    ControlStatus.NOT_FINITE: "a number is not finite",
    ControlStatus.UNSTABLE: "the tubes are about to snap",
    ControlStatus.SOLVER_FAILED: "the solver goes in circles",
    ControlStatus.DRIFTING: "no step toward the target keeps the relative position",
    ControlStatus.OUT_OF_REACH: "no step brings A nearer to the target",
}
"""The status in words."""


class ControlReport:
    """What an iteration did; memory that :meth:`PairControl.step` fills.

    Attributes:
        status: see :class:`ControlStatus`.
        rates: (4n,) of q_AB, m/s and rad/s.
        relative_before: (3,) ε_AB before the step, m.
        relative_after: (3,) and after it.
        tracking_before: (3,) ε_A before the step, m.
        tracking_after: (3,) and after it.
        scales: (2,) task scales s_k, and less where limits slow the motion down; else 1.
        limits_active: bit i: translation i of [A, B] (2n of them) is as fast as it may go; bit
            2n + i: an end or a neighbour holds it back; bit 4n + i: rotation i is at its cap.
        bound_violation: largest violation of (1) with its margins after the step, m.
        peak_rotation: fastest rotation of a tube, rad/s.
        peak_translation: fastest translation, m/s.
        evaluations: how often the kinematics of both arms were evaluated.
    """

    def __init__(self, tubes: int) -> None:
        self.status = ControlStatus.SOLVED
        self.rates = np.zeros(4 * tubes)
        self.relative_before, self.relative_after = np.zeros(3), np.zeros(3)
        self.tracking_before, self.tracking_after = np.zeros(3), np.zeros(3)
        self.scales = np.ones(2)
        self.limits_active = 0
        self.bound_violation = 0.0
        self.peak_rotation = 0.0
        self.peak_translation = 0.0
        self.evaluations = 0


class PairControl:
    """The control of both arms by one method, at one period.

    Attributes:
        pair: the model.
        proximal: the limits of an arm's translations.
        period: of an iteration, s.
        method: name of the method.
    """

    def __init__(
        self,
        design: Concentric,
        period: float,
        method: str | None = None,
        *,
        keeps_limits: bool = False,
    ) -> None:
        """Build it.

        Args:
            design: tubes, gains and limits.
            period: of an iteration, s.
            method: name of the method; None for the configuration's.
            keeps_limits: slow the whole motion down where the paper's methods would break a limit
                that they do not know: gaps between tubes, rotation speeds, for NSPWLN all of them.

        Raises:
            UnknownName: no such method.
            MeaninglessTubes: the model cannot describe the tubes, or they leave no room.
        """
        self.pair, self.proximal, self.period = ArmPair(design), Proximal(design), period
        self._gains = design.relative_gain_per_s, design.tracking_gain_per_s
        self._margin = design.limits.stability_margin
        self._keeps_limits = keeps_limits
        self._problem = RateProblem(self.proximal, design.limits.rotation_speed_rad_s, period)
        self._method: Method = method_named(method or design.method, self._problem)
        self._relative_target, self._tracking_target = np.zeros(3), np.zeros(3)
        self._taken_back = min(design.relative_gain_per_s * period, 1.0)
        self._asked, self._spare = np.zeros(4 * self.pair.count), np.zeros(4 * self.pair.count)
        self._has_spare = False
        self._guess = np.zeros(2 * self.pair.count)

    @property
    def method(self) -> str:
        """Name of the method."""
        return self._method.name

    def step(
        self,
        now: PairKinematics,
        desired: np.ndarray,
        relative: np.ndarray,
        feed_forward: np.ndarray,
        after: PairKinematics,
        report: ControlReport,
    ) -> ControlStatus:
        """One iteration.

        Args:
            now: where both arms stand, evaluated; not changed.
            desired: (3,) where A's tip shall be, base frame, m.
            relative: (3,) x_AB that shall be, m.
            feed_forward: (3,) velocity of ``desired``, m/s.
            after: filled: where both arms stand after the period; as ``now`` if nothing moves.
            report: filled.
        """
        np.subtract(relative, now.relative, out=report.relative_before)
        np.subtract(desired, now.position[0], out=report.tracking_before)
        status = self._ask(now, feed_forward, report)
        if self._keeps_limits and not self._method.corrects:
            self._slow_down()
        if status == ControlStatus.SOLVED:
            status = self._move(now, relative, after, report)
        if status != ControlStatus.SOLVED:
            self._problem.rates[:] = 0.0
            after.take(now)
        self._conclude(now, desired, relative, after, report)
        report.status = status
        return status

    def _slow_down(self) -> None:
        """Make the motion as small as every limit wants it; its direction stays."""
        problem = self._problem
        share = share_within(
            problem.rates,
            problem.box_lower,
            problem.box_upper,
            problem.gap_lower,
            problem.gap_upper,
            problem.rotation_speed,
        )
        problem.rates *= share
        problem.scales *= share

    def _ask(
        self, now: PairKinematics, feed_forward: np.ndarray, report: ControlReport
    ) -> ControlStatus:
        """Rates by the method, from where the arms stand."""
        problem, (relative_gain, tracking_gain) = self._problem, self._gains
        np.multiply(report.relative_before, relative_gain, out=problem.relative_velocity)
        np.multiply(report.tracking_before, tracking_gain, out=problem.tracking_velocity)
        problem.tracking_velocity += feed_forward
        problem.scales[:] = 1.0
        problem.preferred[:] = 0.0
        report.evaluations = 0
        if not (
            _finite(problem.relative_velocity, problem.tracking_velocity)
            and _finite(now.q, now.torsion)
        ):
            return ControlStatus.NOT_FINITE
        problem.stand_at(now.q)
        self._linearise(now)
        if self._method.corrects:
            self._watch_stability(now)
            problem.damping = min(DAMPING_MAX, DAMPING_PER_STEP * self._pace())
        self._relative_target[:] = now.relative + self.period * problem.relative_velocity
        self._tracking_target[:] = now.position[0] + self.period * problem.tracking_velocity
        return self._solve()

    def _watch_stability(self, now: PairKinematics) -> None:
        """How fast the determinants may fall, where an arm comes near snapping.

        Below what is kept they have to rise while A moves, or each step along the boundary would
        lose a little by its curvature. Half of what the rotations alone can do is asked at most, so
        that there are always rates that do; where A is not to move, none have to.
        """
        n, problem = self.pair.count, self._problem
        pace = self._pace()
        for arm in range(2):
            problem.stability_fall[arm] = math.inf
            if now.stability[arm] >= STABILITY_NEAR:
                continue
            slope = problem.stability_slope[arm]
            stability_slope(
                now.q[2 * n * arm : 2 * n * (arm + 1)],
                now.torsion[n * arm : n * (arm + 1)],
                now.torsion_change[arm],
                self.pair.tubes,
                slope,
            )
            left = float(now.stability[arm]) - STABILITY_KEPT * self._margin
            fall = _STABILITY_SHARE * left / self.period
            if fall < 0.0:
                able = 0.5 * problem.rotation_speed * float(np.abs(slope[n:]).sum())
                fall = max(fall * min(pace / _MOVING, 1.0), -able)
            problem.stability_fall[arm] = fall

    def _pace(self) -> float:
        """How far A is asked to go in this iteration, m."""
        wanted = self._problem.tracking_velocity
        return self.period * math.sqrt(float(wanted @ wanted))

    def _linearise(self, at: PairKinematics) -> None:
        self._problem.relative_jacobian[:] = at.relative_jacobian
        self._problem.tracking_jacobian[:] = at.tracking_jacobian

    def _solve(self) -> ControlStatus:
        solution = self._method.solve(self._problem)
        if solution == Solution.INFEASIBLE:
            return ControlStatus.INFEASIBLE
        if solution != Solution.SOLVED:
            return ControlStatus.SOLVER_FAILED
        if not np.isfinite(self._problem.rates).all():
            return ControlStatus.NOT_FINITE
        return ControlStatus.SOLVED

    def _move(
        self,
        now: PairKinematics,
        relative: np.ndarray,
        after: PairKinematics,
        report: ControlReport,
    ) -> ControlStatus:
        """Integrate; refuse what does not converge or snaps.

        A method that corrects takes back what curvature adds to the relative error. Where limits or
        a singular pose leave no way to do so, or where the step overshoots, a share of it is made:
        what curvature adds goes with the square of the share. Without that a target out of reach
        shakes the tubes to and fro between ticks.
        """
        if not self._method.corrects:
            return self._checked(now, after) if self._try(now, after) else _NOT_CONVERGED
        share, status = 1.0, _NOT_CONVERGED
        self._has_spare = False
        self._asked[:] = self._problem.rates
        for _ in range(SHARES):
            np.multiply(self._asked, share, out=self._problem.rates)
            status = self._move_closely(now, relative, after, report, share)
            if status == ControlStatus.SOLVED:
                break
            share *= 0.5
        if status != ControlStatus.SOLVED and self._has_spare:
            self._problem.rates[:] = self._spare
            return ControlStatus.SOLVED if self._try(now, after) else _NOT_CONVERGED
        return status

    def _checked(self, now: PairKinematics, after: PairKinematics) -> ControlStatus:
        """``UNSTABLE`` where an arm comes nearer to snapping than the margin."""
        for arm in range(2):
            if after.stability[arm] < min(self._margin, now.stability[arm]):
                return ControlStatus.UNSTABLE
        return ControlStatus.SOLVED

    def _move_closely(
        self,
        now: PairKinematics,
        relative: np.ndarray,
        after: PairKinematics,
        report: ControlReport,
        share: float,
    ) -> ControlStatus:
        """Integrate and correct; ``DRIFTING`` where the relative error cannot be taken back."""
        before = math.sqrt(float(report.relative_before @ report.relative_before))
        aim = max(RELATIVE_CLOSE, (1.0 - 0.5 * share * self._taken_back) * before)
        off = math.inf
        for correction in range(CORRECTIONS + 1):
            report.evaluations += 1
            if not self._try(now, after):
                return ControlStatus.NOT_CONVERGED
            off = _distance(relative, after.relative)
            if off <= aim or correction == CORRECTIONS:
                break
            status = self._correct(now, after, share)
            if status != ControlStatus.SOLVED:
                return status
        if off > max(RELATIVE_ALLOWED, before):
            if off <= RELATIVE_LOOSE and not self._has_spare and not self._goes_away(now, after):
                self._has_spare = self._checked(now, after) == ControlStatus.SOLVED
                self._spare[:] = self._problem.rates
            return ControlStatus.DRIFTING
        if before <= RELATIVE_ALLOWED and self._goes_away(now, after):
            return ControlStatus.OUT_OF_REACH
        return self._checked(now, after)

    def _goes_away(self, now: PairKinematics, after: PairKinematics) -> bool:
        """Whether A ends further from where it was asked to than it began, without need."""
        if self._problem.stability_fall.min() < 0.0:
            return False
        asked = self._tracking_target
        began, ended = _distance(asked, now.position[0]), _distance(asked, after.position[0])
        return ended > began + _LENGTH_TOLERANCE

    def _correct(self, now: PairKinematics, after: PairKinematics, share: float) -> ControlStatus:
        """Rates near by, linearised at the end of the step, within the limits of its beginning.

        Where that did not do for the whole step, the mean of both ends is used for its shares.
        """
        problem = self._problem
        self._linearise(after)
        if share < 1.0:
            problem.relative_jacobian += now.relative_jacobian
            problem.tracking_jacobian += now.tracking_jacobian
            problem.relative_jacobian *= 0.5
            problem.tracking_jacobian *= 0.5
        np.matmul(problem.tracking_jacobian, problem.rates, out=problem.tracking_velocity)
        np.subtract(self._relative_target, now.relative, out=problem.relative_velocity)
        problem.relative_velocity *= share
        problem.relative_velocity += now.relative
        problem.relative_velocity -= after.relative
        problem.relative_velocity /= self.period
        problem.relative_velocity += problem.relative_jacobian @ problem.rates
        problem.preferred[:], problem.damping = problem.rates, 0.0
        return self._solve()

    def _try(self, now: PairKinematics, after: PairKinematics) -> bool:
        """Where the rates lead to; False where the kinematics do not converge."""
        np.multiply(self._problem.rates, self.period, out=after.q)
        after.q += now.q
        if self._method.corrects:
            self._settle(after.q)
        self.pair.guess_after(now, after.q, self._guess)
        return self.pair.evaluate(after, self._guess) == SOLVED

    def _settle(self, q: np.ndarray) -> None:
        n, limits = self.pair.count, self.proximal
        for start in (0, 2 * n):
            settle_inside(
                q[start : start + n],
                limits.lower,
                limits.upper,
                limits.gap_lower,
                limits.gap_upper,
            )

    def _conclude(
        self,
        now: PairKinematics,
        desired: np.ndarray,
        relative: np.ndarray,
        after: PairKinematics,
        report: ControlReport,
    ) -> None:
        """What the report says beside the status."""
        problem, n = self._problem, self.pair.count
        report.rates[:] = problem.rates
        report.scales[:] = problem.scales
        np.subtract(relative, after.relative, out=report.relative_after)
        np.subtract(desired, after.position[0], out=report.tracking_after)
        report.bound_violation = max(
            self.proximal.excess(after.q[start : start + n]) for start in (0, 2 * n)
        )
        report.peak_translation = float(np.abs(problem.rates[problem.translations]).max())
        report.peak_rotation = float(np.abs(problem.rates[problem.rotations]).max())
        report.limits_active = limits_active(
            problem.rates,
            problem.box_lower,
            problem.box_upper,
            problem.gap_lower,
            problem.gap_upper,
            self.proximal.speed,
            problem.rotation_speed,
        )


@compiled
def _finite(first: np.ndarray, second: np.ndarray) -> bool:
    return bool(np.isfinite(first).all() and np.isfinite(second).all())


@compiled
def _distance(first: np.ndarray, second: np.ndarray) -> float:
    total = 0.0
    for k in range(first.size):
        total += (first[k] - second[k]) ** 2
    return math.sqrt(total)
