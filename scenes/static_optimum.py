"""Offline: the best pose the instrument can take for a desired tip pose, however controlled.

Solved over the shaft's four freedoms at the trocar (turn, tilt, insertion) and the bend, with the
bend limit, by a general bounded solver; the arm is assumed to reach. It shares no code path with
the controller's levels and rates, and so can be held against them.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import minimize

from robot.configuration import Configuration
from robot.records import Case
from robot.rotations import exponential, logarithm
from robot.segment import tip_position, tip_rotation
from robot.start import start_bend, start_shaft_rotation

_MILLI = 1e3


class StaticOptimum:
    """Follows a sequence of desired poses, each solve starting from the last solution."""

    def __init__(self, configuration: Configuration, case: Case) -> None:
        """Start at the configuration's start."""
        self._case = case
        self._instrument = configuration.instrument
        self._weight = configuration.priority.characteristic_length_m
        self._bend_max = math.radians(configuration.limits.bend_deg)
        self._trocar = np.array(configuration.trocar.position_m)
        self._shaft = start_shaft_rotation(configuration)
        u, v = start_bend(configuration)
        self._y = np.array([0.0, 0.0, 0.0, configuration.start.lambda_along_shaft, u, v])

    def _pose(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turn, local, position = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
        exponential(y[:3], turn)
        shaft = turn @ self._shaft
        tip_position(y[4], y[5], self._instrument.segment_length_m, position)
        tip_rotation(y[4], y[5], local)
        beyond = (1.0 - y[3]) * self._instrument.shaft_length_m
        return self._trocar + beyond * shaft[:, 2] + shaft @ position, shaft @ local

    def _errors(
        self, y: np.ndarray, position: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        tip, own = self._pose(y)
        turn = np.empty(3)
        logarithm(rotation @ own.T, turn)
        return position - tip, turn

    def solve(self, position: np.ndarray, rotation: np.ndarray) -> tuple[float, float]:
        """Best position error (m) and orientation error (rad) for a desired tip pose.

        Args:
            position: (3,) desired tip, base frame, m.
            rotation: (3, 3) desired tip orientation.
        """

        def cost(y: np.ndarray) -> float:
            linear, angular = self._errors(y, position, rotation)
            if self._case == Case.LINEAR_FIRST:
                return float(angular @ angular)
            if self._case == Case.ANGULAR_FIRST:
                return float(linear @ linear) * _MILLI
            return float(linear @ linear + self._weight**2 * angular @ angular) * _MILLI

        constraints: list[dict[str, object]] = [
            {"type": "ineq", "fun": lambda y: self._bend_max**2 - y[4] ** 2 - y[5] ** 2}
        ]
        if self._case == Case.LINEAR_FIRST:
            constraints.append(
                {"type": "eq", "fun": lambda y: 10 * self._errors(y, position, rotation)[0]}
            )
        elif self._case == Case.ANGULAR_FIRST:
            constraints.append(
                {"type": "eq", "fun": lambda y: self._errors(y, position, rotation)[1]}
            )
        result = minimize(
            cost,
            self._y,
            method="SLSQP",
            constraints=constraints,
            options={"ftol": 1e-14, "maxiter": 300},
        )
        self._y = result.x
        linear, angular = self._errors(self._y, position, rotation)
        return float(np.linalg.norm(linear)), float(np.linalg.norm(angular))
