"""An oracle: the tendon-driven rod's differential equations, integrated without their integrals.

Rucker and Webster 2011: n' + sum (T_i t_i)' = 0 and m' + p' x n + sum R rho_i x (T_i t_i)' = 0,
solved at each place for the change of the curvature and integrated by scipy from the base.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from hardware.rod.properties import RodProperties

UP = np.array([0.0, 0.0, 1.0])


def spokes(properties: RodProperties) -> np.ndarray:
    """(4, 3) where the tendons are in a cross-section, m."""
    azimuths = np.radians([0.0, 90.0, 180.0, 270.0])
    zero = np.zeros(4)
    return properties.pitch_radius_m * np.stack([np.cos(azimuths), np.sin(azimuths), zero], axis=1)


def stiffness(properties: RodProperties) -> np.ndarray:
    bending = properties.bending_stiffness_n_m2
    return np.diag([bending, bending, properties.torsion_stiffness_n_m2])


def tendon_directions(properties: RodProperties, curvature: np.ndarray) -> np.ndarray:
    """(4, 3) unit vectors along the tendons, frame of the cross-section."""
    along = UP + np.cross(curvature, spokes(properties))
    return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))


class Balance(NamedTuple):
    """What the environment must exert on the tip for these values at the base.

    Attributes:
        position: (3,) of the tip, m.
        rotation: (3, 3) of the tip.
        force: (3,) N.
        moment: (3,) N m.
    """

    position: np.ndarray
    rotation: np.ndarray
    force: np.ndarray
    moment: np.ndarray


class _Equations:
    def __init__(
        self, properties: RodProperties, tensions: np.ndarray, sliding: np.ndarray
    ) -> None:
        self._properties, self._tensions, self._sliding = properties, tensions, sliding
        self._spokes, self._stiffness = spokes(properties), stiffness(properties)

    def tensions(self, bend: float) -> np.ndarray:
        lost = self._sliding * self._properties.friction * bend
        return np.asarray(self._tensions * np.exp(-lost))

    def loads(self, curvature: np.ndarray, change: np.ndarray, bend: float) -> np.ndarray:
        """(4, 3) force of each tendon on the backbone per length, frame of the cross-section."""
        along = UP + np.cross(curvature, self._spokes)
        bent = np.cross(curvature, along) + np.cross(change, self._spokes)
        length = np.linalg.norm(along, axis=1, keepdims=True)
        direction = along / length
        across = bent - np.sum(bent * direction, axis=1, keepdims=True) * direction
        tension = self.tensions(bend)[:, None]
        friction = -self._sliding[:, None] * self._properties.friction * tension
        return np.asarray(
            tension * across / length + friction * np.hypot(*curvature[:2]) * direction
        )

    def slope(self, _: float, state: np.ndarray) -> np.ndarray:
        rotation, curvature = state[3:12].reshape(3, 3), state[12:15]
        force, bend = rotation.T @ state[15:18], state[18]

        def unbalanced(change: np.ndarray) -> np.ndarray:
            loads = self.loads(curvature, change, bend)
            material = self._stiffness @ change + np.cross(curvature, self._stiffness @ curvature)
            tendons = np.sum(np.cross(self._spokes, loads), axis=0)
            return np.asarray(material + np.cross(UP, force) + tendons)

        rest = unbalanced(np.zeros(3))
        matrix = np.stack([unbalanced(unit) - rest for unit in np.eye(3)], axis=1)
        change = np.linalg.solve(matrix, -rest)
        turning = rotation @ np.cross(np.eye(3), curvature)
        fading = -rotation @ np.sum(self.loads(curvature, change, bend), axis=0)
        bending = [np.hypot(*curvature[:2])]
        return np.concatenate([rotation @ UP, turning.ravel(), change, fading, bending])


def tip_balance(
    properties: RodProperties,
    tensions: np.ndarray,
    sliding: np.ndarray,
    curvature: np.ndarray,
    force: np.ndarray,
) -> Balance:
    """Integrate from the base.

    Args:
        properties: the rod.
        tensions: (4,) N.
        sliding: (4,) shares.
        curvature: (3,) at the base, 1/m.
        force: (3,) internal force of the backbone at the base, N.
    """
    equations = _Equations(properties, tensions, sliding)
    start = np.concatenate([np.zeros(3), np.eye(3).ravel(), curvature, force, [0.0]])
    span = (0.0, properties.length_m)
    end = solve_ivp(equations.slope, span, start, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    rotation = end[3:12].reshape(3, 3)
    pulls = equations.tensions(end[18])[:, None] * tendon_directions(properties, end[12:15])
    moments = np.sum(np.cross(spokes(properties), pulls), axis=0)
    return Balance(
        position=end[:3],
        rotation=rotation,
        force=end[15:18] + rotation @ np.sum(pulls, axis=0),
        moment=rotation @ (stiffness(properties) @ end[12:15] + moments),
    )
