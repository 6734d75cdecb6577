"""Which limits of the tubes' rates hold a motion back, and how much of it they leave."""

from __future__ import annotations

import numpy as np

from robot.compiled import compiled

_TOUCH = 1e-9


@compiled
def share_within(
    rates: np.ndarray,
    box_lower: np.ndarray,
    box_upper: np.ndarray,
    gap_lower: np.ndarray,
    gap_upper: np.ndarray,
    rotation_speed: float,
) -> float:
    """Largest s in [0, 1] for which ``s * rates`` keeps every limit; the direction stays.

    Args:
        rates: (4n,) of q_AB, m/s and rad/s.
        box_lower: (4n,) bounds of the rates; rotations have none.
        box_upper: (4n,).
        gap_lower: (2(n − 1),) bounds of the rates of the gaps, A then B, m/s.
        gap_upper: (2(n − 1),).
        rotation_speed: largest, rad/s.
    """
    share = 1.0
    n = rates.size // 4
    for arm in range(2):
        for i in range(n):
            place = 2 * n * arm + i
            share = min(share, _room(rates[place], box_lower[place], box_upper[place]))
            share = min(share, _room(rates[place + n], -rotation_speed, rotation_speed))
            if i > 0:
                gap = (n - 1) * arm + i - 1
                opening = rates[place] - rates[place - 1]
                share = min(share, _room(opening, gap_lower[gap], gap_upper[gap]))
    return share


@compiled
def _room(rate: float, lower: float, upper: float) -> float:
    """Share of ``rate`` that stays between ``lower`` <= 0 and ``upper`` >= 0."""
    if rate > upper:
        return max(upper, 0.0) / rate
    if rate < lower:
        return min(lower, 0.0) / rate
    return 1.0


@compiled
def limits_active(
    rates: np.ndarray,
    box_lower: np.ndarray,
    box_upper: np.ndarray,
    gap_lower: np.ndarray,
    gap_upper: np.ndarray,
    speed: float,
    rotation_speed: float,
) -> int:
    """Bits of ``ControlReport.limits_active``."""
    bits = 0
    n = rates.size // 4
    for arm in range(2):
        for i in range(n):
            place, bit = 2 * n * arm + i, n * arm + i
            rate = rates[place]
            if abs(rate) >= speed * (1.0 - _TOUCH):
                bits |= 1 << bit
            held = False
            for outer in range(max(i, 1), min(i + 2, n)):
                gap = (n - 1) * arm + outer - 1
                opening = rates[2 * n * arm + outer] - rates[2 * n * arm + outer - 1]
                slack = _TOUCH * speed
                held = held or opening <= gap_lower[gap] + slack
                held = held or opening >= gap_upper[gap] - slack
            if held:
                bits |= 1 << (2 * n + bit)
            if abs(rates[place + n]) >= rotation_speed * (1.0 - _TOUCH):
                bits |= 1 << (4 * n + bit)
    return bits
