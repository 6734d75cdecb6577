"""Dexterity measures: manipulability and inverse condition number. Paper 1, eqs. (111)-(113).

The printed measures take J_L and J_A as they are, so they do not depend on the priority case except
through the configuration. What a priority really leaves to a level is the Jacobian projected on the
null space of the levels above it; both are given. For the projection, lambda is taken out of the
RCM first (its two rows perpendicular to the shaft), or lambda's unit would decide the result.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from robot.arm import Arm
from robot.configuration import Configuration
from robot.instrument import point_rates, shaft, tip, tip_jacobian
from robot.parameters import parameters
from robot.records import Case
from robot.urdf import urdf_text

_CUTOFF = 1e-9


class Measure(NamedTuple):
    """Of one Jacobian.

    Attributes:
        inverse_condition: smallest over largest singular value, eq. (113).
        manipulability: product of the singular values, eq. (111).
    """

    inverse_condition: float
    manipulability: float


def measure(jacobian: np.ndarray) -> Measure:
    """Inverse condition number and manipulability of ``jacobian`` (m, n), m <= n."""
    values = np.linalg.svd(jacobian, compute_uv=False)
    largest = float(values.max())
    condition = float(values.min()) / largest if largest > 0.0 else 0.0
    return Measure(condition, float(np.prod(values)))


def _null_projector(jacobian: np.ndarray) -> np.ndarray:
    inverse = np.linalg.pinv(jacobian, rcond=_CUTOFF)
    return np.asarray(np.eye(jacobian.shape[1]) - inverse @ jacobian)


class Dexterity:
    """Measures at any configuration of one robot."""

    def __init__(self, configuration: Configuration) -> None:
        """Build the models."""
        self._parameters = parameters(configuration)
        self._arm = Arm(urdf_text(configuration))

    def jacobians(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """RCM rows perpendicular to the shaft (2, 9), linear (3, 9) and angular (3, 9) rows.

        Columns are the joints, u and v; base frame.

        Args:
            x: (10,) augmented configuration.
        """
        self._arm.update(np.ascontiguousarray(x[:7]))
        arm = self._arm
        length = float(self._parameters[0]["segment_length"])
        base, end, rotation = np.empty(3), np.empty(3), np.empty((3, 3))
        shaft(arm.position, arm.rotation, self._parameters, base, end, rotation)
        position, own = np.empty(3), np.empty((3, 3))
        tip(end, rotation, x[7], x[8], length, position, own)
        full = np.empty((6, 10))
        tip_jacobian(arm.jacobian, rotation, position, x[7], x[8], length, full)
        at_trocar = np.zeros((3, 9))
        point_rates(arm.jacobian, base + x[9] * (end - base), at_trocar[:, :7])
        return rotation[:, :2].T @ at_trocar, full[:3, :9], full[3:, :9]

    def at(self, x: np.ndarray, case: Case) -> dict[str, Any]:
        """Raw and projected measures at ``x`` (10,) under a priority case.

        Returns:
            ``{"raw": {"linear", "angular"}, "projected": {...}}``, each a :class:`Measure` as a
            dictionary. Where two levels share a place (case 0), both are projected below the RCM.
        """
        rcm, linear, angular = self.jacobians(x)
        below_rcm = _null_projector(rcm)
        spaces = {"linear": below_rcm, "angular": below_rcm}
        if case in (Case.LINEAR_FIRST, Case.POINTING):
            spaces["angular"] = _null_projector(np.vstack([rcm, linear]))
        elif case == Case.ANGULAR_FIRST:
            spaces["linear"] = _null_projector(np.vstack([rcm, angular]))
        rows = {"linear": linear, "angular": angular}
        return {
            "raw": {name: measure(jacobian)._asdict() for name, jacobian in rows.items()},
            "projected": {
                name: measure(jacobian @ spaces[name])._asdict() for name, jacobian in rows.items()
            },
        }
