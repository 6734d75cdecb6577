"""The concentric tubes' model checked and timed, with nothing else running in this process."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from benchmarks.percentiles import percentiles
from benchmarks.tubes import GeneralSolver, overlapping
from robot.concentric.design import Concentric
from robot.concentric.kinematics import SOLVED, solve_arm
from robot.concentric.pair import ArmPair, PairKinematics, start_of
from robot.concentric.stability import BranchFollower, TubesSnap
from scenes.experiments.tube_paths import tube_path
from scenes.experiments.tube_starts import random_starts
from server.report.tube_tasks import PATHS, RANDOM_SEED
from server.run.tube_run import TubeRun, TubeTask

OVERLAPS_MM = (0, 80)
"""Curved overlap, summed over the pairs of tubes, at which an arm is timed."""
_STARTS, _TICKS, _WARM_UP = 50, 2000, 100
_QUICK_STARTS, _QUICK_TICKS, _QUICK_POINTS = 2, 200, 5
_STEP = 1e-5
_TRANSLATION, _ROTATION, _PHASE = 2e-3, 0.2, 0.02


@dataclass(frozen=True)
class TubeMeasures:
    """What was measured.

    Attributes:
        states: how many random stable states of an arm were checked.
        tips_apart_mm: largest distance of the tip from that of a general solver.
        jacobian_off: largest difference of the tips' Jacobians from central differences, m/m and
            m/rad, as a share of the largest entry where that is above 1.
        arm_ms: by overlap in mm: kinematics and Jacobian of one arm, median and 99th percentile.
        iteration_ms: a control iteration of both arms with hqp, median and 99th percentile.
    """

    states: int
    tips_apart_mm: float
    jacobian_off: float
    arm_ms: dict[int, tuple[float, float]]
    iteration_ms: tuple[float, float]


def measure_tubes(design: Concentric, quick: bool) -> TubeMeasures:
    """Check and time.

    Args:
        design: the tubes.
        quick: a few states and ticks only.
    """
    pair = ArmPair(design)
    drawn = random_starts(design, _QUICK_STARTS if quick else _STARTS, RANDOM_SEED)
    apart, off = 0.0, 0.0
    for q in drawn:
        standing = PairKinematics(pair.count)
        standing.q[:] = q
        if pair.evaluate_cold(standing) != SOLVED:
            raise TubesSnap(q)
        apart = max(apart, _tips_apart(pair, standing))
        off = max(off, _jacobian_off(pair, standing))
    ticks = _QUICK_TICKS if quick else _TICKS
    return TubeMeasures(
        2 * len(drawn),
        1e3 * apart,
        off,
        {overlap: _arm_ms(pair.tubes, 1e-3 * overlap, ticks) for overlap in OVERLAPS_MM},
        _iteration_ms(design, _QUICK_POINTS if quick else None),
    )


def _tips_apart(pair: ArmPair, standing: PairKinematics) -> float:
    """Largest distance of a tip from the general solver's, m."""
    n, peer = pair.count, GeneralSolver(pair.tubes)
    apart = 0.0
    for arm in range(2):
        torsion = standing.torsion[n * arm : n * (arm + 1)]
        tip = peer.tip(standing.q[2 * n * arm : 2 * n * (arm + 1)], torsion)
        off = standing.position[arm] - pair.channels[arm] - tip
        apart = max(apart, float(np.linalg.norm(off)))
    return apart


def _jacobian_off(pair: ArmPair, standing: PairKinematics) -> float:
    """J_A and J_AB against central differences, extrapolated once."""
    size = standing.q.size
    beside, guess = PairKinematics(pair.count), np.zeros_like(standing.torsion)

    def tasks_at(place: int, step: float) -> np.ndarray:
        beside.q[:] = standing.q
        beside.q[place] += step
        pair.guess_after(standing, beside.q, guess)
        if pair.evaluate(beside, guess) != SOLVED:
            raise TubesSnap(beside.q)
        return np.concatenate([beside.position[0], beside.relative])

    slopes = np.empty((6, size))
    for place in range(size):
        fine, coarse = (
            (tasks_at(place, step) - tasks_at(place, -step)) / (2.0 * step)
            for step in (_STEP, 2.0 * _STEP)
        )
        slopes[:, place] = (4.0 * fine - coarse) / 3.0
    ours = np.vstack([standing.tracking_jacobian, standing.relative_jacobian])
    return float(np.max(np.abs(ours - slopes)) / max(1.0, float(np.max(np.abs(slopes)))))


def _arm_ms(tubes: np.ndarray, overlap: float, ticks: int) -> tuple[float, float]:
    """One arm solved again and again while it moves, as in a control tick."""
    n, start = len(tubes), overlapping(tubes, overlap)
    outputs = np.empty(3), np.empty((3, 3)), np.empty((6, 2 * n))
    torsion = BranchFollower(start, tubes).torsion
    change, stability = np.empty((n, 2 * n)), np.empty(1)
    times: list[int] = []
    for index in range(ticks + _WARM_UP):
        q = start.copy()
        q[:n] += _TRANSLATION * np.sin(_PHASE * index)
        q[n:] += _ROTATION * np.sin(_PHASE * index * np.arange(1, n + 1) / n)
        began = time.perf_counter_ns()
        status = solve_arm(q, torsion, tubes, *outputs, torsion, change, stability)
        times.append(time.perf_counter_ns() - began)
        if status != SOLVED:
            raise TubesSnap(q)
    return _milliseconds(times[_WARM_UP:])


def _iteration_ms(design: Concentric, points: int | None) -> tuple[float, float]:
    times: list[int] = []
    for path in PATHS:
        for number, start in enumerate(design.starts, 1):
            task = TubeTask(path, str(number), start_of(start), tube_path(path)[:points])
            result = TubeRun(design, task, "hqp").execute(lambda _: None, lambda: False)
            times += result.time_ns
    return _milliseconds(times)


def _milliseconds(times: list[int]) -> tuple[float, float]:
    found = percentiles(times)
    return 1e-3 * found["p50"], 1e-3 * found["p99"]
