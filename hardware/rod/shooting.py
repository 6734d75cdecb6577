"""Finding the tip's place, the contact force and the sliding shares that agree with each other.

The unknowns are where the tip is (it gives the moment at the base), how hard the platform pushes,
and how far each tendon has slid. Contact and friction are equations with a kink; Newton's method
takes at each iteration the side on which it stands, and the derivatives of the rod itself by finite
differences, brought up to date by Broyden's rule as long as that is good enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hardware.rod.integration import OUTCOMES, STATE, UNKNOWNS, outcome, sensitivity
from hardware.rod.platform import Platform
from hardware.rod.properties import RodProperties
from hardware.rod.tendons import TendonState
from robot.errors import KeyholeError

STEPS = 60
"""Steps of the integration along the rod."""

_TOLERANCE = 1e-10  # of the tip's place and the penetration over L, and of the shares
_ITERATIONS = 40
_SHORTEST = 2.0**-7
_SLOW = 0.3
_SINGULAR = 1e14
_LEAPS = 6
_LEAP = 0.3


class RodNotSolved(KeyholeError):
    """No shape of the rod was found that balances its loads.

    Attributes:
        tensions: (4,) at the base where the search came to a stop, N.
        force: (3,) on the tip apart from the contact, N.
        residual: largest error that is left: of the tip's place over the length, of the shares.
        iterations: iterations made.
    """

    code = "rod_not_solved"

    def __init__(
        self, tensions: np.ndarray, force: np.ndarray, residual: float, iterations: int
    ) -> None:
        written = ", ".join(f"{tension:.4g}" for tension in tensions)
        pushed = ", ".join(f"{component:.4g}" for component in force)
        super().__init__(
            f"the rod was not solved at tensions [{written}] N and tip force [{pushed}] N: "
            f"{residual:.2g} is left after {iterations} iterations; load it in smaller steps"
        )
        self.tensions, self.force = tensions, force
        self.residual, self.iterations = residual, iterations


@dataclass(frozen=True)
class Task:
    """What the rod is loaded with.

    Attributes:
        properties: the rod.
        tensions: (4,) at the base, N.
        force: (3,) on the tip apart from the contact, N.
        moment: (3,) on the tip, N m.
        tendons: sliding shares that are to follow the tendons' travel (``follows``) or hold.
        follows: whether they follow.
        platform: what the tip may touch.
        steps: of the integration along the rod.
    """

    properties: RodProperties
    tensions: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    tendons: TendonState
    follows: bool
    platform: Platform | None = None
    steps: int = STEPS


class Solution(NamedTuple):
    """An answer, and what the next search may start from.

    Attributes:
        unknowns: (8,) place of the tip over L, contact force (N), sliding shares.
        outcome: (7,) place of the tip and changes of length, m.
        slope: (7, 8) outcome by unknowns, roughly.
        nodes: (n, 12) see ``integration.trace``.
        curvatures: (n, 3) in the frame of the cross-section, 1/m.
        iterations: how many it took.
    """

    unknowns: np.ndarray
    outcome: np.ndarray
    slope: np.ndarray
    nodes: np.ndarray
    curvatures: np.ndarray
    iterations: int


class _Trial(NamedTuple):
    """What came of a choice of the unknowns.

    Attributes:
        unknowns: (8,) as chosen.
        outcome: (7,) what came of them.
        nodes: (n, 12) see ``integration.trace``.
        curvatures: (n, 3) 1/m.
        error: (8,) what should be zero.
        by_unknowns: (8, 8) its derivative by the unknowns while the outcome stays.
        by_outcome: (8, 7) its derivative by the outcome.
        size: norm of the error; infinite where there is none.
    """

    unknowns: np.ndarray
    outcome: np.ndarray
    nodes: np.ndarray
    curvatures: np.ndarray
    error: np.ndarray
    by_unknowns: np.ndarray
    by_outcome: np.ndarray
    size: float


class _Search:
    """Tries choices of the unknowns for one task."""

    def __init__(self, task: Task) -> None:
        self._task = task
        platform = task.platform
        self._rod = task.properties.constants()
        self._length = task.properties.length_m
        # A force of this size bends the rod visibly; it makes contact forces comparable to lengths.
        self._usual_force = 3.0 * task.properties.bending_stiffness_n_m2 / self._length**2
        self._normal = np.zeros(3) if platform is None else platform.direction
        self._free = np.array([True] * 3 + [platform is not None] + [task.follows] * 4)

    def trial(self, unknowns: np.ndarray) -> _Trial:
        """What comes of these unknowns (8,)."""
        task = self._task
        nodes = np.empty((task.steps + 1, STATE))
        curvatures, out = np.empty((task.steps + 1, 3)), np.empty(OUTCOMES)
        loads = (task.tensions, task.force, task.moment, self._normal)
        outcome(unknowns, self._rod, *loads, nodes, curvatures, out)
        conditions = self._conditions(unknowns, out)
        size = float(np.linalg.norm(conditions[0]))
        size = size if np.isfinite(size) else np.inf
        return _Trial(unknowns, out, nodes, curvatures, *conditions, size)

    def slope(self, here: _Trial) -> np.ndarray:
        """(7, 8) outcome by unknowns, by finite differences."""
        task = self._task
        out = np.zeros((OUTCOMES, UNKNOWNS))
        loads = (task.tensions, task.force, task.moment, self._normal)
        sensitivity(here.unknowns, self._free, self._rod, *loads, task.steps, here.outcome, out)
        return out

    def shortened(self, here: _Trial, step: np.ndarray) -> _Trial:
        """As much of a step as makes the error smaller, or very little of it."""
        share, there = 1.0, here
        while not there.size < (1.0 - 0.1 * share) * here.size and share > _SHORTEST:
            share *= 0.5
            there = self.trial(here.unknowns + share * step)
        return there

    def _conditions(
        self, unknowns: np.ndarray, out: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What should be zero (8,), and its derivatives by unknowns (8, 8) and outcome (8, 7)."""
        task, length = self._task, self._length
        by_unknowns, by_outcome = np.eye(UNKNOWNS), np.zeros((UNKNOWNS, OUTCOMES))
        error = unknowns.copy()
        error[:3] -= out[:3] / length
        by_outcome[range(3), range(3)] = -1.0 / length
        error[3] /= self._usual_force
        by_unknowns[3, 3] /= self._usual_force
        if task.platform is not None:
            stiffness = task.platform.stiffness_n_m
            gap = (unknowns[3] / stiffness - task.platform.penetration(out[:3])) / length
            if error[3] > gap:  # the smaller of the two is to be zero
                error[3], by_unknowns[3, 3] = gap, 1.0 / (stiffness * length)
                by_outcome[3, :3] = self._normal / length
        shares = task.tendons.sliding
        if task.follows:
            stick = task.properties.stick_m
            shares = task.tendons.reached(out[3:], stick)
            for i in np.flatnonzero(np.abs(shares) < 1.0):
                by_outcome[4 + i, 3 + i] = 1.0 / stick
        error[4:] -= np.clip(shares, -1.0, 1.0)
        return error, by_unknowns, by_outcome


def search(task: Task, unknowns: np.ndarray, slope: np.ndarray | None = None) -> Solution:
    """Find the rod's balance near a start.

    Args:
        task: the loads.
        unknowns: (8,) start: place of the tip over L, contact force (N), sliding shares.
        slope: (7, 8) ``Solution.slope`` of a search near here, to save differentiating anew.

    Raises:
        RodNotSolved: the search does not come to an end.
    """
    trials = _Search(task)
    here = trials.trial(np.array(unknowns, dtype=float))
    fresh, leaps = False, _LEAPS
    for iteration in range(_ITERATIONS):
        if slope is None:
            slope, fresh = trials.slope(here), True
        if np.max(np.abs(here.error)) < _TOLERANCE:
            return Solution(*here[:2], slope, *here[2:4], iteration)
        matrix = here.by_unknowns + here.by_outcome @ slope
        if not np.all(np.isfinite(matrix)) or np.linalg.cond(matrix) > _SINGULAR:
            break
        step = np.linalg.solve(matrix, -here.error)
        there = trials.trial(here.unknowns + step)
        if not fresh and not there.size < _SLOW * here.size:
            slope = None
            continue
        if not there.size < 0.9 * here.size:
            # Across a kink the error may rise on the way to where it vanishes.
            if leaps > 0 and np.isfinite(there.size) and np.max(np.abs(step)) < _LEAP:
                leaps -= 1
            else:
                there = trials.shortened(here, step)
                if not there.size < here.size:
                    break
        change = there.unknowns - here.unknowns
        unforeseen = there.outcome - here.outcome - slope @ change
        slope = slope + np.outer(unforeseen, change) / (change @ change)
        here, fresh = there, False
    left = float(np.max(np.abs(here.error))) if np.isfinite(here.size) else np.inf
    raise RodNotSolved(task.tensions, task.force, left, iteration)
