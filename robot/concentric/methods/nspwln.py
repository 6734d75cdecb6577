"""NSPWLN: null-space projection with a weighted least norm, eqs. (4)-(6); it knows no hard limit.

Weights keep translations away from the ends of their moving bounds; rotations cost little.
"""

from __future__ import annotations

import numpy as np

from robot.concentric.methods.rate_problem import RateProblem, Solution

TRANSLATION_WEIGHT = 30.0
ROTATION_WEIGHT = 1e-3
TRACKING_WEIGHT = 1e8
_ROOM_MIN_MM = 1e-3
"""Room to a bound below which the slope of H stops growing."""


def limit_slope(beta: np.ndarray, least: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """|∂H/∂β_i| of Chan and Dubey's H = Σ (max − min)² / (4 (max − β)(β − min)), in 1/mm.

    With millimetres, in which the paper gives its tubes, w_i differs from 1 in the last few
    millimetres before a bound. With metres it is a thousand times steeper, and the translations are
    given up for rotations that swing the tips about.

    Args:
        beta: translations, m.
        least: their least values, m.
        largest: their largest, m.
    """
    above = np.maximum(1e3 * (largest - beta), _ROOM_MIN_MM)
    below = np.maximum(1e3 * (beta - least), _ROOM_MIN_MM)
    slope = (1e3 * (largest - least)) ** 2 * (below - above) / (4.0 * above**2 * below**2)
    return np.asarray(np.abs(slope))


def weights(problem: RateProblem) -> np.ndarray:
    """Diagonal (4n,) of W_act.lim: λ_t w_i for translations, λ_r for rotations."""
    found = np.full(len(problem.rates), ROTATION_WEIGHT)
    slope = limit_slope(problem.beta, problem.least, problem.largest).ravel()
    found[problem.translations] = TRANSLATION_WEIGHT * (1.0 + slope)
    return found


def weighted_inverse(jacobian: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(JᵀW_track J + W)⁻¹ Jᵀ W_track, written as W⁻¹Jᵀ (J W⁻¹Jᵀ + W_track⁻¹)⁻¹.

    The second form inverts a matrix of the size of the task; the first mixes numbers that are
    1e11 apart.

    Args:
        jacobian: (m, k).
        weight: (k,) diagonal of W.
    """
    across = jacobian.T / weight[:, None]
    gram = jacobian @ across
    gram[np.diag_indices_from(gram)] += 1.0 / TRACKING_WEIGHT
    return np.asarray(np.linalg.solve(gram, across.T).T)


def printed_inverse(jacobian: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """inv(J_AB) (4n, 3) as eq. (6) prints it: of the left and of the right half, separately.

    Each half inverts the whole task, so J_AB·inv(J_AB) is twice the identity, and
    I − inv(J_AB)·J_AB is no projector: it turns a motion of the task around.
    """
    half = jacobian.shape[1] // 2
    return np.vstack(
        [
            weighted_inverse(jacobian[:, :half], weight[:half]),
            weighted_inverse(jacobian[:, half:], weight[half:]),
        ]
    )


class PrintedNspwln:
    """Eq. (6) as printed."""

    name = "nspwln"
    corrects = False

    def solve(self, problem: RateProblem) -> Solution:
        """Fill the problem's rates."""
        weight, half = weights(problem), len(problem.rates) // 2
        inverse = printed_inverse(problem.relative_jacobian, weight)
        secondary = np.zeros(len(problem.rates))
        own = weighted_inverse(problem.tracking_jacobian[:, :half], weight[:half])
        secondary[:half] = own @ problem.tracking_velocity
        left = problem.relative_velocity - problem.relative_jacobian @ secondary
        problem.rates[:] = secondary + inverse @ left
        return Solution.SOLVED


class RepairedNspwln:
    """The weighted inverse of both tasks stacked, in its dual form."""

    name = "nspwln-repaired"
    corrects = False

    def solve(self, problem: RateProblem) -> Solution:
        """Fill the problem's rates."""
        stacked = np.vstack([problem.relative_jacobian, problem.tracking_jacobian])
        wanted = np.concatenate([problem.relative_velocity, problem.tracking_velocity])
        problem.rates[:] = weighted_inverse(stacked, weights(problem)) @ wanted
        return Solution.SOLVED
