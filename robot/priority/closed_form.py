"""The paper's closed forms, eqs. (47) and (52)-(69): pseudo-inverses, no limits.

The second solver, and the oracle of the first. Corrections: in (52), (54), (63) the projector is
I - J_rcm^+ J_rcm - B^+ B (the print has J_L in it); in (73) the sign is minus, so that lambda is
drawn to lambda_0 rather than driven away.
"""

from __future__ import annotations

import math

import numpy as np

from robot.priority.levels import Plan

_CUTOFF = 1e-9
"""Singular values below this share of the largest count as zero."""


def polar_columns(u: float, v: float) -> np.ndarray:
    """(10, 10) matrix that turns rates of [q, theta, delta, lambda] into rates of x.

    At the straight segment the column of delta vanishes: that is the polar coordinates' own hole.
    """
    phi = math.hypot(u, v)
    delta = math.atan2(v, u) if phi > 0.0 else 0.0
    change = np.eye(10)
    change[7:9, 7:9] = [
        [-math.cos(delta), -phi * math.sin(delta)],
        [-math.sin(delta), phi * math.cos(delta)],
    ]
    return change


def prioritized(
    plan: Plan, catalogue: np.ndarray, targets: np.ndarray, preferred: np.ndarray
) -> np.ndarray:
    """Rates by successive null-space projection; eqs. (54), (63) for cases 1 and 2.

    With P_0 = I, level k adds (J_k P)^+ (b_k - J_k x_dot) and takes (J_k P)^+ (J_k P) out of P; for
    the RCM, linear and angular levels these are the paper's J_rcm, B and C.

    Args:
        plan: the levels.
        catalogue: (10, 10) task rows.
        targets: (10,) their wanted rates.
        preferred: (10,) rates for the freedom that is left (the paper's eta).
    """
    rates = np.zeros(10)
    projector = np.eye(10)
    for span in plan.spans():
        rows = plan.rows[span.start : span.stop]
        weights = plan.weights[span.start : span.stop]
        jacobian = weights[:, None] * catalogue[rows]
        projected = jacobian @ projector
        inverse = np.linalg.pinv(projected, rcond=_CUTOFF)
        rates = rates + inverse @ (weights * targets[rows] - jacobian @ rates)
        projector = projector - inverse @ projected
    return np.asarray(rates + projector @ preferred)


def augmented(catalogue: np.ndarray, targets: np.ndarray, preferred: np.ndarray) -> np.ndarray:
    """Rates by the augmented Jacobian, eq. (47) as printed: the RCM beside the tip, no priority.

    Args:
        catalogue: (10, 10) task rows; the first nine are RCM, linear and angular.
        targets: (10,) their wanted rates.
        preferred: (10,) the paper's eta.
    """
    jacobian = catalogue[:9]
    inverse = np.linalg.pinv(jacobian, rcond=_CUTOFF)
    projector = np.eye(10) - inverse @ jacobian
    return np.asarray(inverse @ targets[:9] + projector @ preferred)
