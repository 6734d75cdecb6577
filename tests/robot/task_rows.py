"""The catalogue of task rows at any configuration, put together from the public Jacobians."""

from __future__ import annotations

import numpy as np

from robot.arm import Arm
from robot.instrument import ROWS, rcm_jacobian, shaft, tip, tip_jacobian


def jacobians(
    arm: Arm, parameters: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tip (6, 10) and RCM (3, 10) Jacobian at ``x`` (10,), base frame; the tip frame (3, 3)."""
    base, end, rotation = np.empty(3), np.empty(3), np.empty((3, 3))
    position, own = np.empty(3), np.empty((3, 3))
    length = float(parameters[0]["segment_length"])
    arm.update(np.ascontiguousarray(x[:7]))
    shaft(arm.position, arm.rotation, parameters, base, end, rotation)
    tip(end, rotation, x[7], x[8], length, position, own)
    of_tip, of_rcm = np.empty((6, 10)), np.empty((3, 10))
    tip_jacobian(arm.jacobian, rotation, position, x[7], x[8], length, of_tip)
    rcm_jacobian(arm.jacobian, base, end, x[9], of_rcm)
    return of_tip, of_rcm, own


def catalogue(arm: Arm, parameters: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(10, 10) rows: RCM and linear in the base frame, angular in the tip frame, lambda."""
    rows = np.zeros((ROWS, 10))
    of_tip, rows[:3], own = jacobians(arm, parameters, x)
    rows[3:6], rows[6:9] = of_tip[:3], own.T @ of_tip[3:]
    rows[9, 9] = 1.0
    return rows
