"""The proximal constraint: where tubes may stand against each other, and how fast they may go.

Tubes count from the innermost, β < 0 is how far a tube's rear end stands behind the channel exit,
ℓ is its length. Paper 2 (Alsaka, Cinquin & Chikhaoui 2024), eq. (1), with the two margins of its
Fig. 2: the rear ends of neighbours stay ``motor_spacing_mm`` apart, and each tube shows
``minimum_segment_mm`` more than the one around it, the outermost that much more than the channel:

    motor_spacing <= β_n − β_(n−1) <= ℓ_(n−1) − ℓ_n − minimum_segment
    β_N <= 0,      β_N >= −ℓ_N + minimum_segment

The rest of (1) follows from these. A neighbour that moves meanwhile takes room away, so the
differences are rows of their own; boxes that are drawn anew each step (eq. (7)) are overrun.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.concentric.design import Concentric
from robot.concentric.tubes import MeaninglessTubes


class Proximal:
    """The limits of one arm's translations, as arrays.

    Attributes:
        count: tubes of an arm, n.
        lengths: (n,) of the tubes, m.
        lower: (n,) least β of each tube wherever the others stand, m.
        upper: (n,) largest β, m.
        gap_lower: (n − 1,) least β_n − β_(n−1), m.
        gap_upper: (n − 1,) largest, m.
        speed: of a translation, m/s.
        acceleration: with which a translation brakes before a limit, m/s².
    """

    def __init__(self, design: Concentric) -> None:
        """Read them; raises ``MeaninglessTubes`` where the margins leave a tube no room."""
        limits = design.limits
        lengths = np.array([tube.length_mm for tube in design.tubes]) * 1e-3
        spacing, segment = limits.motor_spacing_mm * 1e-3, limits.minimum_segment_mm * 1e-3
        outward = np.arange(len(lengths) - 1, -1, -1)
        self.count, self.lengths = len(lengths), lengths
        self.lower = -lengths + segment * (1 + outward)
        self.upper = -spacing * outward
        self.gap_lower = np.full(self.count - 1, spacing)
        self.gap_upper = lengths[:-1] - lengths[1:] - segment
        self._refuse_without_room()
        self.speed = limits.translation_speed_mm_s * 1e-3
        self.acceleration = limits.translation_acceleration_mm_s2 * 1e-3
        for bounds in (self.lower, self.upper, self.gap_lower, self.gap_upper, lengths):
            bounds.setflags(write=False)

    def _refuse_without_room(self) -> None:
        rooms = [*(self.gap_upper - self.gap_lower), self.upper[-1] - self.lower[-1]]
        for number, room in enumerate(rooms, 1):
            if not room > 0.0:
                raise MeaninglessTubes(
                    number,
                    f"minimum_segment_mm and motor_spacing_mm leave it {1e3 * room:g} mm to move",
                )

    def rows(self) -> np.ndarray:
        """The (n − 1, 2n) rows of [β, α] whose rates are those of the gaps."""
        rows = np.zeros((self.count - 1, 2 * self.count))
        for n in range(self.count - 1):
            rows[n, n], rows[n, n + 1] = -1.0, 1.0
        return rows

    def excess(self, beta: np.ndarray) -> float:
        """How far translations (n,), m, stand outside of (1) with its margins, m; 0 inside."""
        return float(excess(beta, self.lower, self.upper, self.gap_lower, self.gap_upper))


@compiled
def excess(
    beta: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    gap_lower: np.ndarray,
    gap_upper: np.ndarray,
) -> float:
    """Largest violation of the limits (see :class:`Proximal`) by translations (n,), m."""
    worst = 0.0
    for n in range(beta.size):
        worst = max(worst, lower[n] - beta[n], beta[n] - upper[n])
        if n > 0:
            gap = beta[n] - beta[n - 1]
            worst = max(worst, gap_lower[n - 1] - gap, gap - gap_upper[n - 1])
    return worst


@compiled
def moving_bounds(
    beta: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    gap_lower: np.ndarray,
    gap_upper: np.ndarray,
    least: np.ndarray,
    largest: np.ndarray,
) -> None:
    """Bounds [β_min,i, β_max,i] of each tube while the others stand still, eq. (1).

    As the paper draws them, a tube is bounded by the one inside it; the innermost by its own ends.

    Args:
        beta: (n,) translations, m.
        lower: (n,) see :class:`Proximal`.
        upper: (n,).
        gap_lower: (n − 1,).
        gap_upper: (n − 1,).
        least: (n,) filled with β_min,i, m.
        largest: (n,) filled with β_max,i, m.
    """
    for n in range(beta.size):
        least[n], largest[n] = lower[n], upper[n]
        if n > 0:
            least[n] = max(least[n], beta[n - 1] + gap_lower[n - 1])
            largest[n] = min(largest[n], beta[n - 1] + gap_upper[n - 1])


@compiled
def braking_rate(room: float, period: float, speed: float, acceleration: float) -> float:
    """Largest rate toward a limit that is ``room`` away: eq. (7), never past it, never below 0."""
    left = max(room, 0.0)
    return min(left / period, speed, math.sqrt(2.0 * acceleration * left))


@compiled
def box_of_eq7(
    beta: np.ndarray,
    least: np.ndarray,
    largest: np.ndarray,
    period: float,
    speed: float,
    acceleration: float,
    lower: np.ndarray,
    upper: np.ndarray,
) -> None:
    """The paper's Q̇_min and Q̇_max, eq. (7), for translations between their moving bounds.

    Outside of its bounds, where a neighbour may put it and the print's square root is not a number,
    a tube has to come back, as fast as it may go.

    Args:
        beta: (n,) translations, m.
        least: (n,) β_min,i, m.
        largest: (n,) β_max,i, m.
        period: T, s.
        speed: V_max, m/s.
        acceleration: A_max, m/s².
        lower: (n,) filled, m/s.
        upper: (n,) filled, m/s.
    """
    for n in range(beta.size):
        below, above = beta[n] - least[n], largest[n] - beta[n]
        lower[n] = -braking_rate(below, period, speed, acceleration)
        upper[n] = braking_rate(above, period, speed, acceleration)
        if below < 0.0:
            lower[n] = min(-below / period, speed)
        if above < 0.0:
            upper[n] = max(above / period, -speed)


@compiled
def gap_rates(
    beta: np.ndarray,
    gap_lower: np.ndarray,
    gap_upper: np.ndarray,
    period: float,
    speed: float,
    acceleration: float,
    lower: np.ndarray,
    upper: np.ndarray,
) -> None:
    """Bounds of the rates of the gaps, with braking; zero always lies inside.

    Both neighbours may move, so a gap changes at up to twice a tube's speed and brakes with both.

    Args:
        beta: (n,) translations, m.
        gap_lower: (n − 1,) see :class:`Proximal`.
        gap_upper: (n − 1,).
        period: s.
        speed: of one tube, m/s.
        acceleration: of one tube, m/s².
        lower: (n − 1,) filled, m/s.
        upper: (n − 1,) filled, m/s.
    """
    for n in range(beta.size - 1):
        gap = beta[n + 1] - beta[n]
        lower[n] = -braking_rate(gap - gap_lower[n], period, 2.0 * speed, 2.0 * acceleration)
        upper[n] = braking_rate(gap_upper[n] - gap, period, 2.0 * speed, 2.0 * acceleration)


@compiled
def settle_inside(
    beta: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    gap_lower: np.ndarray,
    gap_upper: np.ndarray,
) -> None:
    """Take back, in place, what the QP solver's tolerance (1e-10 m) leaves outside of the limits.

    From the outermost tube inward; a tube inside its own ends always finds room beside the next.

    Args:
        beta: (n,) translations after a step, m.
        lower: (n,) see :class:`Proximal`.
        upper: (n,).
        gap_lower: (n − 1,).
        gap_upper: (n − 1,).
    """
    last = beta.size - 1
    beta[last] = min(max(beta[last], lower[last]), upper[last])
    for n in range(last - 1, -1, -1):
        beta[n] = min(max(beta[n], beta[n + 1] - gap_upper[n]), beta[n + 1] - gap_lower[n])
