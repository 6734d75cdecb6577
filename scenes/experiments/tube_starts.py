"""Random configurations of the two concentric-tube arms, inside (1) and far from snapping."""

from __future__ import annotations

import numpy as np

from robot.concentric.design import Concentric
from robot.concentric.kinematics import SOLVED
from robot.concentric.pair import ArmPair, PairKinematics
from robot.concentric.proximal import Proximal

SHOWN_MIN_M, SHOWN_MAX_M = 0.010, 0.100
"""How much more than the tube around it, or the channel, a tube shows."""
ROOM_M = 0.005
"""Least distance from the limits, but for the tubes' ends."""
STABILITY_MIN = 0.2
_TRIES = 10_000


def _translations(proximal: Proximal, rng: np.random.Generator) -> np.ndarray | None:
    """Translations (n,) of one arm, m; None where they leave no room."""
    shown = rng.uniform(SHOWN_MIN_M, SHOWN_MAX_M, proximal.count)
    tips = np.cumsum(shown[::-1])[::-1]
    beta = tips - proximal.lengths
    gaps = np.diff(beta)
    inside = (
        np.all(beta >= proximal.lower + ROOM_M)
        and np.all(beta <= proximal.upper - ROOM_M)
        and np.all(gaps >= proximal.gap_lower + ROOM_M)
        and np.all(gaps <= proximal.gap_upper - ROOM_M)
    )
    return np.asarray(beta) if inside else None


def _is_stable(pair: ArmPair, kinematics: PairKinematics, q: np.ndarray) -> bool:
    """Whether the tubes stand at ``q`` (4n,) far from snapping, on the branch without a turn more.

    A determinant above 0 is necessary only; ``evaluate_cold`` follows it from untwisted tubes.
    """
    kinematics.q[:] = q
    solved = pair.evaluate_cold(kinematics) == SOLVED
    return solved and bool(kinematics.stability.min() >= STABILITY_MIN)


def random_starts(design: Concentric, count: int, seed: int) -> np.ndarray:
    """Configurations (count, 4n) of both arms, m and rad, the same for the same seed.

    Args:
        design: tubes and limits.
        count: how many.
        seed: which ones.

    Raises:
        RuntimeError: the tubes leave hardly any room (ten thousand draws per start did not do).
    """
    rng = np.random.default_rng(seed)
    pair, proximal = ArmPair(design), Proximal(design)
    n, kinematics = pair.count, PairKinematics(pair.count)
    starts = np.empty((count, 4 * n))
    found = 0
    for _ in range(_TRIES * count):
        if found == count:
            break
        parts: list[np.ndarray] = []
        for _ in range(2):
            beta = _translations(proximal, rng)
            if beta is not None:
                parts += [beta, rng.uniform(-np.pi, np.pi, n)]
        if len(parts) == 4:
            starts[found] = np.concatenate(parts)
            found += _is_stable(pair, kinematics, starts[found])
    if found < count:
        raise RuntimeError("the tubes leave no room for random starts")
    return starts
