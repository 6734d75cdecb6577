"""The slope of the stability determinant, and that hqp stays away from where it vanishes."""

from __future__ import annotations

import numpy as np

from robot.concentric.control import STABILITY_NEAR, ControlReport, ControlStatus
from robot.concentric.kinematics import SOLVED
from robot.concentric.pair import PairKinematics
from robot.concentric.stability_slope import stability_slope
from tests.robot.concentric.pair_problem import (
    TUBES,
    at,
    configurations,
    control,
    design,
    pair,
)

LONG_OVERLAP = np.array([-0.280, -0.165, -0.050])
"""Translations, m, at which the curved parts of all three tubes overlap."""


def turned(angles: tuple[float, float, float]) -> np.ndarray:
    """Both arms with their curved parts overlapping, A's tubes turned to ``angles``, rad."""
    return np.concatenate([LONG_OVERLAP, angles, LONG_OVERLAP, [0.0, 0.3, -0.2]])


def test_the_slope_is_the_derivative_of_the_determinant() -> None:
    step, moved, slope = 1e-6, PairKinematics(TUBES), np.empty(2 * TUBES)
    for q in (*configurations()[3:], turned((0.0, 2.0, 1.0))):
        now = at(q)
        stability_slope(q[:6], now.torsion[:3], now.torsion_change[0], pair().tubes, slope)
        for place in range(2 * TUBES):
            values = []
            for sign in (1.0, -1.0):
                moved.q[:] = q
                moved.q[place] += sign * step
                assert pair().evaluate(moved, now.torsion) == SOLVED
                values.append(moved.stability[0])
            expected = (values[0] - values[1]) / (2.0 * step)
            assert abs(slope[place] - expected) < 1e-5 * (1.0 + abs(expected))
        assert abs(slope[TUBES:].sum()) < 1e-5  # turning all tubes changes nothing


def test_hqp_slides_along_the_margin_instead_of_running_into_it(rng: np.random.Generator) -> None:
    """A's tubes are turned apart to just before they snap, then A is sent anywhere."""
    margin = design().limits.stability_margin
    near = now = at(turned((0.0, 0.0, 0.0)))
    for angle in np.arange(0.02, 3.2, 0.02):
        now = PairKinematics(TUBES)
        now.q[:] = turned((angle, -0.4 * angle, 0.0))
        if pair().evaluate(now, near.torsion) != SOLVED or now.stability[0] < 0.12:
            break
        near = now
    assert near.stability[0] < STABILITY_NEAR
    chosen, report, lowest = control("hqp"), ControlReport(TUBES), 1.0
    for _ in range(12):
        now, after = PairKinematics(TUBES), PairKinematics(TUBES)
        now.take(near)
        relative = now.relative.copy()
        desired = now.position[0] + rng.uniform(-0.02, 0.02, 3)
        for _ in range(15):
            status = chosen.step(now, desired, relative, np.zeros(3), after, report)
            assert status in (ControlStatus.SOLVED, ControlStatus.OUT_OF_REACH)
            assert after.stability.min() >= min(margin, now.stability.min())
            lowest = min(lowest, after.stability.min())
            now, after = after, now
    assert lowest < 0.8 * near.stability[0]
