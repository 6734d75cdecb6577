"""The rod: at once under given loads, or as it goes through one load after the other."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hardware.rod.platform import Platform
from hardware.rod.properties import RodProperties
from hardware.rod.shooting import STEPS, RodNotSolved, Solution, Task, search
from hardware.rod.tendons import TendonState, checked_tensions, unmoved

_FINEST = 2.0**-10
_REFUSALS = 60
_BOLDEST = 0.5
"""Largest increment of the loads, as the bend (rad) it would roughly add; with larger ones the
search could land on another shape than the one that the loads lead to."""


class RodShape(NamedTuple):
    """The rod at rest, in the segment's base frame.

    Attributes:
        positions: (n, 3) m, from the base to the tip.
        rotations: (n, 3, 3) of the cross-sections.
        fractions: (n,) of the length, from 0 to 1.
        lengths: (4,) changes q of the tendons' lengths from the straight rod, m; pulled < 0.
        force: (3,) on the tip, contact included, N.
        curvatures: (n, 3) in the frame of the cross-section, 1/m; the third is torsion.
        bends: (n,) accumulated bend from the base, rad.
        sliding: (4,) shares of friction, 1 for a tendon that slides toward the base.
    """

    positions: np.ndarray
    rotations: np.ndarray
    fractions: np.ndarray
    lengths: np.ndarray
    force: np.ndarray
    curvatures: np.ndarray
    bends: np.ndarray
    sliding: np.ndarray

    @property
    def tip_position(self) -> np.ndarray:
        """(3,) m."""
        return np.asarray(self.positions[-1])

    @property
    def tip_rotation(self) -> np.ndarray:
        """(3, 3)."""
        return np.asarray(self.rotations[-1])


def solve_rod(
    properties: RodProperties,
    tensions: np.ndarray,
    sliding: np.ndarray,
    force: np.ndarray,
    moment: np.ndarray | None = None,
    guess: RodShape | None = None,
    steps: int = STEPS,
) -> RodShape:
    """The rod's shape when it is known how its tendons slide.

    Args:
        properties: the rod.
        tensions: (4,) at the base, N.
        sliding: (4,) shares in [-1, 1].
        force: (3,) of the environment on the tip, segment base frame, N.
        moment: (3,) of the environment on the tip, N m; none by default.
        guess: a shape under similar loads; it also chooses where there are several.
        steps: of the integration along the rod.

    Raises:
        TensionRefused: a tendon would have to push.
        RodNotSolved: no shape was found, not even by increasing the force step by step.
    """
    state = TendonState(np.array(sliding, dtype=float), np.zeros(4))
    pushed = np.array(force, dtype=float)
    turned = np.zeros(3) if moment is None else np.array(moment, dtype=float)
    task = Task(properties, checked_tensions(tensions), pushed, turned, state, False, None, steps)
    if guess is not None:
        # A guess only saves time: without a shape near it, the search begins without the force.
        with contextlib.suppress(RodNotSolved):
            return _shape(task, search(task, _start(properties, state, guess.tip_position)))
    # Without a force the moment is known everywhere, wherever the tip is.
    unloaded = replace(task, force=np.zeros(3))
    at_first = search(
        unloaded, _start(properties, state, np.array([0.0, 0.0, properties.length_m]))
    )
    return _shape(task, _by_increments(unloaded, task, at_first)[0])


class Rod:
    """A rod that goes slowly through its loads and remembers how its tendons have slid.

    Attributes:
        properties: of the rod.
        platform: what the tip may touch; may be replaced between two steps.
        shape: the last one; straight at first, with slack tendons.
        iterations: of the last search.
    """

    def __init__(self, properties: RodProperties, platform: Platform | None = None) -> None:
        self.properties, self.platform = properties, platform
        nothing = np.zeros(3)
        self._task = Task(properties, np.zeros(4), nothing, nothing, unmoved(), True)
        straight = np.array([0.0, 0.0, properties.length_m])
        self._last = search(self._task, _start(properties, unmoved(), straight))
        self.shape = _shape(self._task, self._last)
        self.iterations = 0

    @property
    def sliding(self) -> np.ndarray:
        """(4,) shares of friction in [-1, 1]; 1 for a tendon that slides toward the base."""
        return self.shape.sliding

    def step(self, tensions: np.ndarray, force: np.ndarray | None = None) -> RodShape:
        """Go straight to other loads.

        Args:
            tensions: (4,) at the base, N.
            force: (3,) on the tip besides the platform's, N; none by default.

        Returns:
            The new shape, with the shares of friction that its own changes of length ask for.

        Raises:
            TensionRefused: a tendon would have to push.
            RodNotSolved: no shape was found; the rod stays as it was.
        """
        pushed = np.zeros(3) if force is None else np.array(force, dtype=float)
        before = replace(self._task, tendons=self._tendons(), platform=self.platform)
        task = replace(before, tensions=checked_tensions(tensions), force=pushed)
        self._last, self._task = _by_increments(before, task, self._last)
        self.iterations = self._last.iterations
        self.shape = _shape(self._task, self._last)
        return self.shape

    def _tendons(self) -> TendonState:
        return _tendons_after(self._task, self._last)


def _by_increments(before: Task, task: Task, start: Solution) -> tuple[Solution, Task]:
    """Go from the loads of one task to those of another, in as many steps as it takes.

    Returns:
        The answer, and the task of its last step.

    Raises:
        RodNotSolved: not even the smallest step succeeds, or too many do not.
    """
    boldest = _boldest(before, task)
    done, share, refusals = 0.0, boldest, 0
    here, tendons = start, before.tendons
    while True:
        aim = min(done + share, 1.0)
        part = replace(
            task,
            tensions=(1.0 - aim) * before.tensions + aim * task.tensions,
            force=(1.0 - aim) * before.force + aim * task.force,
            tendons=tendons,
        )
        try:
            there = search(part, here.unknowns, here.slope)
        except RodNotSolved:
            share, refusals = 0.5 * share, refusals + 1
            if share < _FINEST * boldest or refusals > _REFUSALS:
                raise
            continue
        if aim == 1.0:
            return there, part
        done, here, share = aim, there, min(2.0 * share, boldest)
        tendons = _tendons_after(part, there)


def _boldest(before: Task, task: Task) -> float:
    """Share of the way between two loads that may be gone at once."""
    rod = task.properties
    moment = float(np.linalg.norm(task.force - before.force)) * rod.length_m / 2.0
    if np.any(task.force) or task.platform is not None:
        pulled = float(np.max(np.abs(task.tensions - before.tensions)))
        moment += rod.pitch_radius_m * pulled
    bend = moment * rod.length_m / rod.bending_stiffness_n_m2
    return min(1.0, _BOLDEST / bend) if bend > 0.0 else 1.0


def _tendons_after(task: Task, solution: Solution) -> TendonState:
    if not task.follows:
        return task.tendons
    lengths = solution.outcome[3:]
    reached = task.tendons.reached(lengths, task.properties.stick_m)
    return TendonState(np.clip(reached, -1.0, 1.0), lengths)


def _start(properties: RodProperties, tendons: TendonState, tip: np.ndarray) -> np.ndarray:
    return np.concatenate([tip / properties.length_m, [0.0], tendons.sliding])


def _shape(task: Task, solution: Solution) -> RodShape:
    nodes = solution.nodes
    force = task.force.copy()
    if task.platform is not None:
        force += solution.unknowns[3] * task.platform.direction
    return RodShape(
        positions=nodes[:, :3].copy(),
        rotations=_rotations(nodes[:, 3:7]),
        fractions=np.linspace(0.0, 1.0, len(nodes)),
        lengths=solution.outcome[3:].copy(),
        force=force,
        curvatures=solution.curvatures.copy(),
        bends=nodes[:, 7].copy(),
        sliding=_tendons_after(task, solution).sliding.copy(),
    )


def _rotations(wxyz: np.ndarray) -> np.ndarray:
    """(n, 3, 3) rotation matrices of (n, 4) unit quaternions."""
    w, x, y, z = wxyz.T
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))
