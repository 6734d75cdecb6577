"""Colours of the scene, sRGB 0-255.

Desired, commanded, measured, estimated and true look the same here, on the operator page and in its
plots; whoever changes one changes both.
"""

from __future__ import annotations

Colour = tuple[int, int, int]

DESIRED: Colour = (47, 125, 225)
COMMANDED: Colour = (138, 92, 214)
MEASURED: Colour = (217, 138, 0)
ESTIMATED: Colour = (138, 16, 96)
"""Always in broken lines too: hoops around the segment here, dashes in the plots."""
TRUE: Colour = (31, 157, 107)

# The scene's light is strong: solid bodies come out lighter than what stands here.
TENDONS: tuple[Colour, ...] = ((190, 22, 18), (205, 140, 0), (0, 110, 150), (140, 20, 130))
"""Tendons 1 to 4, at 0, 90, 180 and 270 degrees about the segment's z axis."""

TUBES: tuple[Colour, ...] = (
    (14, 128, 150),
    (176, 52, 120),
    (132, 98, 30),
    (70, 82, 104),
    (104, 132, 20),
    (150, 76, 60),
)
"""Concentric tubes, the innermost first; the page's plots have the same."""
ENDOSCOPE: Colour = (150, 156, 168)
CHANNEL: Colour = (40, 44, 52)
FAINT: Colour = (158, 124, 144)
"""An estimate that does not stand out from its uncertainty."""
UNKNOWN: Colour = (124, 130, 142)
"""A direction along which nothing is known, as a broken line."""
WARNING: Colour = (196, 26, 36)
"""What should be and is not; always said in words or by a broken line too."""

BACKBONE: Colour = (52, 56, 64)
DISK: Colour = (112, 118, 130)
PORT: Colour = (54, 64, 80)
WALL: Colour = (206, 108, 88)
RCM: Colour = (214, 40, 90)
BALL: Colour = (236, 186, 30)
GROOVE: Colour = (122, 78, 62)
PEDESTAL: Colour = (120, 126, 138)
TOUCHED: Colour = (255, 70, 10)
"""What the instrument touches."""
PASSED: Colour = (22, 176, 58)
"""A ring that the tip has gone half-way through."""
PLINTH: Colour = (136, 142, 152)
GRID_CELL: Colour = (150, 155, 165)
GRID_SECTION: Colour = (122, 128, 140)
