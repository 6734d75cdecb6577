"""Colours of the scene, sRGB 0-255.

Desired, commanded, measured and true look the same here, on the operator page and in its plots;
whoever changes one changes both.
"""

from __future__ import annotations

Colour = tuple[int, int, int]

DESIRED: Colour = (47, 125, 225)
COMMANDED: Colour = (138, 92, 214)
MEASURED: Colour = (217, 138, 0)
TRUE: Colour = (31, 157, 107)

TENDONS: tuple[Colour, ...] = ((224, 62, 54), (240, 186, 22), (20, 160, 190), (200, 70, 180))
"""Tendons 1 to 4, at 0, 90, 180 and 270 degrees about the segment's z axis."""

BACKBONE: Colour = (96, 102, 112)
DISK: Colour = (176, 182, 192)
PORT: Colour = (54, 64, 80)
WALL: Colour = (226, 152, 132)
RCM: Colour = (214, 40, 90)
PLINTH: Colour = (120, 127, 138)
GRID_CELL: Colour = (168, 174, 184)
GRID_SECTION: Colour = (128, 135, 147)
