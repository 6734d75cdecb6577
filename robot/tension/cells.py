"""Whether the torque cells of the tendons can be believed."""

from __future__ import annotations

from robot.compiled import compiled
from robot.records import RecordFields

_LONGEST_TICK_S = 0.02
"""What one tick counts at most: a late one has seen no more readings than another."""


@compiled
def follow_cells(s: RecordFields, tick_input: RecordFields) -> None:
    """Note for how long each cell has read the same to the last bit (``cell_same``, s)."""
    for i in range(4):
        # NaN is never the same: what is missing is not flat.
        if tick_input.measured_tension[i] == s.cell_read[i]:
            s.cell_same[i] += min(tick_input.dt_s, _LONGEST_TICK_S)
        else:
            s.cell_read[i] = tick_input.measured_tension[i]
            s.cell_same[i] = 0.0


@compiled
def is_flat(s: RecordFields, cell: int, flat_s: float) -> bool:
    """Whether a cell has stopped to change, though its noise alone would change it; never where
    ``flat_s`` is 0.
    """
    return bool(flat_s > 0.0 and s.cell_same[cell] >= flat_s)


@compiled
def cells_read(s: RecordFields, tick_input: RecordFields, p: RecordFields) -> bool:
    """Whether all cells give a reading inside their range that goes on changing."""
    for i in range(4):
        # False for NaN too.
        if not tick_input.measured_tension[i] < p.tension_full_scale or is_flat(s, i, p.cell_flat):
            return False
    return bool(tick_input.tension_cells != 0)
