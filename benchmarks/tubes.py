"""One arm of concentric tubes, solved as in a control tick, beside a general solver.

Both run in the same process, turn by turn, so that whatever slows the machine slows both. Ours is
everything: torsion, tip, Jacobian, stability, from the torsion of the tick before. The peer is
scipy: the same equations by ``solve_ivp`` and ``root`` from the same guess, for the tip alone. A
whole tick of both arms, by each method, stands beside the period that the console has for it.
"""

from __future__ import annotations

import time
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from benchmarks.percentiles import percentiles
from hardware.tube_plant import TubePlant
from robot.concentric.concentric_robot import ConcentricRobot
from robot.concentric.design import METHODS
from robot.concentric.kinematics import SOLVED, solve_arm
from robot.concentric.stability import BranchFollower, TubesSnap
from robot.concentric.tubes import tube_array
from robot.configuration import Configuration
from robot.records import Request, Safety
from scenes.experiments.tube_playing import played
from server.control.concentric_loop import ConcentricLoop

OVERLAPS_MM = (0, 50, 80)
"""Curved overlap, summed over the pairs of tubes."""

_WARM_UP = 200
_TRANSLATION, _ROTATION, _PHASE = 2e-3, 0.2, 0.02


def _overlap(tips: np.ndarray, curved: np.ndarray) -> float:
    """Curved overlap in m, summed over the pairs, of tubes that end at ``tips`` (n,)."""
    pairs = combinations(zip(tips - curved, tips, strict=True), 2)
    return float(sum(max(0.0, min(a[1], b[1]) - max(a[0], b[0])) for a, b in pairs))


def overlapping(tubes: np.ndarray, overlap: float) -> np.ndarray:
    """(2n,) configuration whose tips follow each other evenly, with a curved ``overlap`` (m)."""
    count = len(tubes)
    curved = tubes["length"] - tubes["straight_length"]
    last = min(2.0 * float(curved[-1]), float(tubes["length"][-1]) - 2.0 * _TRANSLATION)
    low, high = 0.0, float(curved.max())
    order = np.arange(count)[::-1]
    for _ in range(50):
        spacing = 0.5 * (low + high)
        more = _overlap(last + spacing * order, curved) > overlap
        low, high = (spacing, high) if more else (low, spacing)
    rotations = np.linspace(0.0, 1.0, count)
    return np.concatenate([last + high * order - tubes["length"], rotations])


class GeneralSolver:
    """The tip of one arm by scipy's integrator and root finder."""

    def __init__(self, tubes: np.ndarray) -> None:
        """Take ``tubes`` (n,)."""
        self._tubes = tubes

    def _shoot(self, q: np.ndarray, torsion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        tubes, n = self._tubes, len(torsion)
        end, begin = q[:n] + tubes["length"], q[:n] + tubes["straight_length"]
        y = np.concatenate([q[n:] - q[:n] * torsion, torsion, np.eye(3).ravel(), np.zeros(3)])
        left = torsion.copy()
        stops = np.unique(np.clip(np.concatenate([[0.0], begin, end]), 0.0, end[0]))
        for low, high in pairwise(stops):
            there = end > 0.5 * (low + high)
            bends = tubes["bending_stiffness"] * tubes["curvature"]
            bends = np.where(there & (begin < 0.5 * (low + high)), bends, 0.0)
            whole = tubes["bending_stiffness"][there].sum()

            def slope(
                _: float, y: np.ndarray, bends: np.ndarray = bends, whole: float = whole
            ) -> np.ndarray:
                c, s = np.cos(y[:n]), np.sin(y[:n])
                x, z = bends @ c / whole, bends @ s / whole
                frame = y[2 * n : 2 * n + 9].reshape(3, 3)
                hat = np.array([[0.0, 0.0, z], [0.0, 0.0, -x], [-z, x, 0.0]])
                twist = bends / tubes["torsional_stiffness"] * (s * x - c * z)
                return np.concatenate([y[n : 2 * n], twist, (frame @ hat).ravel(), frame[:, 2]])

            y = solve_ivp(slope, (low, high), y, rtol=1e-9, atol=1e-9).y[:, -1]
            left = np.where(there, y[n : 2 * n], left)
        return y[-3:], left

    def tip(self, q: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """(3,) m, of the solution near ``guess`` (n,)."""
        torsion = root(lambda rates: self._shoot(q, rates)[1], guess, tol=1e-9).x
        return self._shoot(q, torsion)[0]


def _alternate(tubes: np.ndarray, overlap: float, ticks: int, turns: int) -> dict[str, Any]:
    """Figures of ``ticks`` of ours with ``turns`` of the peer spread among them."""
    n, start = len(tubes), overlapping(tubes, overlap)
    position, rotation, jacobian = np.empty(3), np.empty((3, 3)), np.empty((6, 2 * n))
    change, stability = np.empty((n, 2 * n)), np.empty(1)
    torsion = BranchFollower(start, tubes).torsion
    peer = GeneralSolver(tubes)
    ours: list[int] = []
    theirs: list[int] = []
    between = max(ticks // turns, 1)
    apart = 0.0
    for index in range(ticks + _WARM_UP):
        phase = _PHASE * index
        q = start.copy()
        q[:n] += _TRANSLATION * np.sin(phase)
        q[n:] += _ROTATION * np.sin(phase * np.arange(1, n + 1) / n)
        began = time.perf_counter_ns()
        status = solve_arm(
            q, torsion, tubes, position, rotation, jacobian, torsion, change, stability
        )
        ended = time.perf_counter_ns()
        if status != SOLVED:
            raise TubesSnap(q)
        if index < _WARM_UP:
            continue
        ours.append(ended - began)
        if (index - _WARM_UP) % between == 0:
            began = time.perf_counter_ns()
            tip = peer.tip(q, torsion)
            theirs.append(time.perf_counter_ns() - began)
            apart = max(apart, float(np.max(np.abs(tip - position))))
    arm_us, scipy_us = percentiles(ours), percentiles(theirs)
    return {
        "arm_us": arm_us,
        "scipy_us": scipy_us,
        "ratio_p50": arm_us["p50"] / scipy_us["p50"],
        "tips_apart_mm": apart * 1e3,
    }


def _whole_ticks(configuration: Configuration, ticks: int) -> dict[str, Any]:
    """Ticks of both arms by each method on the rectangle, and the loop's period beside them."""
    period_us = 1e6 / configuration.concentric.rate_hz
    figures: dict[str, Any] = {"period_us": period_us}
    for method in METHODS:
        design = configuration.concentric.model_copy(update={"method": method})
        update = {"robot": "concentric", "concentric": design}
        chosen = configuration.model_copy(update=update)
        robot = ConcentricRobot(chosen)
        plant = TubePlant(chosen, robot.initial_state()["q"][0])
        loop = ConcentricLoop(robot, plant, chosen)
        loop.request = Request.ENABLE
        loop.step()
        loop.start_path(played("rectangle"))
        took = []
        for index in range(ticks + _WARM_UP):
            loop.step()
            if index >= _WARM_UP:
                took.append(int(loop.record["header"]["tick_ns"][0]))
        if loop.safety != Safety.ENABLED:
            raise TubesSnap(loop.record["truth"]["q"][0])
        tick_us = percentiles(took)
        figures[method] = {"tick_us": tick_us, "share_of_period_p99": tick_us["p99"] / period_us}
    return figures


def measure(configuration: Configuration, seconds: float) -> dict[str, Any]:
    """Measure.

    Args:
        configuration: its concentric tubes.
        seconds: about how long it takes; the peer takes nearly all of it.

    Returns:
        For each curved overlap (``overlap_0_mm`` ...): ``arm_us`` and ``scipy_us`` with p50 and
        p99, ``ratio_p50``, ``tips_apart_mm``; ``tick``: for each method the whole tick of both
        arms beside the loop's period; and ``ticks`` of ours, ``turns`` of the peer.
    """
    tubes = tube_array(configuration.concentric.tubes)
    turns = min(max(round(seconds * 5.0), 3), 100)
    ticks = min(max(round(seconds * 1e3), 1000), 10000)
    document: dict[str, Any] = {
        f"overlap_{overlap}_mm": _alternate(tubes, overlap * 1e-3, ticks, turns)
        for overlap in OVERLAPS_MM
    }
    document["tick"] = _whole_ticks(configuration, min(ticks, 2000))
    return {**document, "ticks": ticks, "turns": turns}
