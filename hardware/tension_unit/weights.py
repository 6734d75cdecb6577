"""Known weights, hung on the pulleys of a unit one after the other, and what its cells read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hardware.tension_unit.module import CYCLE_S, MODULES, POSITION
from hardware.tension_unit.unit import SimulatedUnit
from robot.sensing.torque_cell_calibration import STANDARD_GRAVITY
from robot.tension_unit_design import TensionUnit

WEIGHTS_KG = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0)
_SETTLE_S, _READ_S = 0.3, 0.2
_SOFT_N_M = 50.0
"""A weight on a soft spring pulls as hard whatever the pulley does."""


def hang_weights(
    design: TensionUnit, seed: int, weights_kg: Sequence[float] = WEIGHTS_KG
) -> np.ndarray:
    """Mean readings (weights, 4) of the cells in N m with each weight on every pulley.

    Args:
        design: the table ``[tension_unit]``.
        seed: the unit whose cells they are.
        weights_kg: one after the other.
    """
    readings = np.empty((len(weights_kg), MODULES))
    cycles, read = round(_SETTLE_S / CYCLE_S), round(_READ_S / CYCLE_S)
    for row, weight in zip(readings, weights_kg, strict=True):
        pull = weight * STANDARD_GRAVITY
        unit = SimulatedUnit(design, np.random.default_rng(seed), _SOFT_N_M, 0.0, pull)
        row[:] = 0.0
        for cycle in range(cycles + read):
            unit.cycle([POSITION] * MODULES, unit.zero)
            if cycle >= cycles:
                np.add(row, unit.state["cell"][0] / read, out=row)
    return readings
