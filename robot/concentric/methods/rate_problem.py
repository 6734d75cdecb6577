"""One sample's question to a method, and its answer: memory that both sides share."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from robot.concentric.proximal import Proximal, box_of_eq7, gap_rates, moving_bounds

UNBOUNDED = 1e30
"""What daqp takes for no bound."""


class Solution(IntEnum):
    """What a method says of its own answer."""

    SOLVED = 1
    INFEASIBLE = 2
    FAILED = 3


class RateProblem:
    """Both arms' tasks and limits, linearised at one sample; SI throughout.

    Unknowns are the rates of q_AB = [β_A, α_A, β_B, α_B], 4n of them, in m/s and rad/s.

    Attributes:
        tubes: tubes of an arm, n.
        proximal: limits of the translations.
        rotation_speed: cap that hqp keeps, rad/s.
        period: T, s.
        translations: (2n,) places of the translations of A, then of B, in q_AB.
        rotations: (2n,) places of the rotations.
        relative_jacobian: (3, 4n) J_AB, x_AB = p_B − p_A.
        tracking_jacobian: (3, 4n) J_A, zeros for B.
        relative_velocity: (3,) v_AB, m/s.
        tracking_velocity: (3,) v_A, m/s.
        beta: (2, n) translations of A and B, m.
        least: (2, n) their moving bounds β_min,i, m.
        largest: (2, n) β_max,i, m.
        box_lower: (4n,) Q̇_min of eq. (7); rotations are not bounded.
        box_upper: (4n,) Q̇_max.
        gap_lower: (2(n − 1),) bounds of the rates of the gaps between neighbours, A then B, m/s.
        gap_upper: (2(n − 1),).
        stability_slope: (2, 2n) derivative of each arm's stability determinant by its q.
        stability_fall: (2,) how fast hqp may let it fall, 1/s; below 0 it has to rise; infinite far
            from snapping, where the slope is of no use.
        preferred: (4n,) rates that hqp takes where its levels leave freedom.
        damping: of the levels of hqp.
        rates: (4n,) the answer.
        scales: (2,) task scales s_k of the answer, 1 where a method has none.
    """

    def __init__(self, proximal: Proximal, rotation_speed: float, period: float) -> None:
        n = proximal.count
        self.tubes, self.proximal = n, proximal
        self.rotation_speed, self.period = rotation_speed, period
        self.translations = np.concatenate([np.arange(n), 2 * n + np.arange(n)])
        self.rotations = self.translations + n
        self.relative_jacobian = np.zeros((3, 4 * n))
        self.tracking_jacobian = np.zeros((3, 4 * n))
        self.relative_velocity, self.tracking_velocity = np.zeros(3), np.zeros(3)
        self.beta, self.least, self.largest = np.zeros((2, n)), np.zeros((2, n)), np.zeros((2, n))
        self.box_lower = np.full(4 * n, -UNBOUNDED)
        self.box_upper = np.full(4 * n, UNBOUNDED)
        self.gap_lower, self.gap_upper = np.zeros(2 * (n - 1)), np.zeros(2 * (n - 1))
        self.stability_slope = np.zeros((2, 2 * n))
        self.stability_fall = np.full(2, np.inf)
        self.preferred, self.damping = np.zeros(4 * n), 0.0
        self.rates, self.scales = np.zeros(4 * n), np.ones(2)

    def stand_at(self, q: np.ndarray) -> None:
        """Draw the limits anew for the configuration q_AB (4n,)."""
        n, limits = self.tubes, self.proximal
        for arm in range(2):
            start = 2 * n * arm
            gaps = slice((n - 1) * arm, (n - 1) * (arm + 1))
            beta, least, largest = self.beta[arm], self.least[arm], self.largest[arm]
            beta[:] = q[start : start + n]
            moving_bounds(
                beta,
                limits.lower,
                limits.upper,
                limits.gap_lower,
                limits.gap_upper,
                least,
                largest,
            )
            speed = self.period, limits.speed, limits.acceleration
            box = self.box_lower[start : start + n], self.box_upper[start : start + n]
            box_of_eq7(beta, least, largest, *speed, *box)
            gap_rates(
                beta,
                limits.gap_lower,
                limits.gap_upper,
                *speed,
                self.gap_lower[gaps],
                self.gap_upper[gaps],
            )
