"""Four coloured pegs at the corners of a square, standing on a plate."""

from __future__ import annotations

import numpy as np

from robot.configuration import Configuration
from scenes.boards.place import place
from scenes.boards.solids import Board, Solid, bar, plate

PEG_DISTANCE = 0.023
"""Between one peg and the next, m (paper, section 5.3)."""
CORNERS = PEG_DISTANCE * np.array([[0, 0], [-1, 0], [-1, 1], [0, 1]], dtype=float)
"""(4, 2) x and y of the pegs from the tip at the start, base frame, m, as they are visited."""
CLEARANCE = 0.0045
"""From the tops of the pegs to the instrument as it passes over them at the start's height, m."""

_COLOURS = {
    "green": (46, 148, 72),
    "red": (196, 44, 40),
    "blue": (38, 92, 190),
    "yellow": (214, 170, 16),
}
_PEG_RADIUS = 0.0022
_PEG_HEIGHT = 0.022
_PLATE = (205, 208, 214)


def pegboard(configuration: Configuration) -> Board:
    """Pegs whose tops lie under the corners of the square of the experiment."""
    here = place(configuration)
    top = here.tip - np.array([0.0, 0.0, here.tip_radius + CLEARANCE + _PEG_RADIUS])
    bottom = top - np.array([0.0, 0.0, _PEG_HEIGHT])
    middle = np.array([*CORNERS.mean(axis=0), 0.0])
    half = 0.5 * PEG_DISTANCE + 0.012
    solids: list[Solid] = [
        plate("plate", bottom + middle, (half, half), 0.006, np.eye(3), _PLATE),
    ]
    for (name, rgb), corner in zip(_COLOURS.items(), CORNERS, strict=True):
        offset = np.array([*corner, 0.0])
        solids.append(bar(f"{name} peg", bottom + offset, top + offset, _PEG_RADIUS, rgb))
    return Board("pegboard", "Pegboard: four pegs 23 mm apart", tuple(solids))
