"""The tubes as elastic rods, integrated by a general solver: shares no formula with the model.

Each tube has its own frame along the common backbone, its own moments in it, and the rod's balance
of moments m' + u × m = 0, of which the third component is integrated. The common frame turns with
the innermost tube. Shooting finds the torsion at the exit.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

_TOLERANCE = 1e-11


class RodShape(NamedTuple):
    """A solution.

    Attributes:
        position: (3,) of the tip, m.
        rotation: (3, 3) of the innermost tube's frame at the tip.
        torsion: (n,) at the exit, rad/m.
        left: (n,) torsion left at the tubes' ends, rad/m.
    """

    position: np.ndarray
    rotation: np.ndarray
    torsion: np.ndarray
    left: np.ndarray


def _slope(
    y: np.ndarray, tubes: np.ndarray, there: np.ndarray, precurvature: np.ndarray
) -> np.ndarray:
    n = len(tubes)
    angle, torsion = y[:n], y[n : 2 * n]
    frame = y[2 * n : 2 * n + 9].reshape(3, 3)
    stiffness = np.where(there, tubes["bending_stiffness"], 0.0)
    # No moment acts from outside: the tubes' moments in the common frame add up to zero.
    bend_x = stiffness @ (precurvature * np.cos(angle)) / stiffness.sum()
    bend_y = stiffness @ (precurvature * np.sin(angle)) / stiffness.sum()
    own_x = np.cos(angle) * bend_x + np.sin(angle) * bend_y
    own_y = np.cos(angle) * bend_y - np.sin(angle) * bend_x
    moment_x, moment_y = stiffness * (own_x - precurvature), stiffness * own_y
    twist = -(own_x * moment_y - own_y * moment_x) / tubes["torsional_stiffness"]
    u = np.array([bend_x, bend_y, torsion[0]])
    hat = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
    return np.concatenate([torsion - torsion[0], twist, (frame @ hat).ravel(), frame[:, 2]])


def _shoot(q: np.ndarray, tubes: np.ndarray, torsion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The state at the tip, and the torsion left at the tubes' ends."""
    n = len(tubes)
    end = q[:n] + tubes["length"]
    begin = q[:n] + tubes["straight_length"]
    turned = q[n:] - q[:n] * torsion
    c, s = np.cos(turned[0]), np.sin(turned[0])
    frame = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    y = np.concatenate([turned - turned[0], torsion, frame.ravel(), np.zeros(3)])
    stops = np.unique(np.clip(np.concatenate([[0.0], begin, end]), 0.0, end[0]))
    left = torsion.copy()
    for low, high in pairwise(stops):
        middle = 0.5 * (low + high)
        there = end > middle
        precurvature = np.where(there & (begin < middle), tubes["curvature"], 0.0)
        solved = solve_ivp(
            lambda _, y, there=there, precurvature=precurvature: _slope(
                y, tubes, there, precurvature
            ),
            (low, high),
            y,
            method="DOP853",
            rtol=_TOLERANCE,
            atol=_TOLERANCE,
        )
        y = solved.y[:, -1]
        left = np.where(there, y[n : 2 * n], left)
    return y, left


def solve_rods(q: np.ndarray, tubes: np.ndarray, guess: np.ndarray) -> RodShape:
    """Solve from ``guess`` (n,), which chooses the branch."""
    n = len(tubes)
    solved = root(lambda torsion: _shoot(q, tubes, torsion)[1], guess, tol=1e-11)
    y, left = _shoot(q, tubes, solved.x)
    return RodShape(y[-3:], y[2 * n : 2 * n + 9].reshape(3, 3), solved.x, left)
