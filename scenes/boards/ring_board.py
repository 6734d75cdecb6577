"""Six rings at different angles on posts; the tip shall go half-way through each.

The instrument comes from above and behind, so that rings that stand beside each other across its
way, on posts from below, leave its shaft free.
"""

from __future__ import annotations

import math

import numpy as np

from robot.configuration import Configuration
from scenes.boards.place import Place, place
from scenes.boards.solids import Board, Colour, Ring, Solid, bar, fixed, plate

CLEAR_RADIUS = 0.00405
"""Of the opening, m (paper, section 5.4: 8.1 mm across)."""
POSES = (
    (0.022, 0.034, 0.000, 30.0, 0.0),
    (0.027, 0.020, 0.010, 12.0, 14.0),
    (0.029, 0.007, -0.002, -14.0, -10.0),
    (0.029, -0.007, 0.009, 16.0, 6.0),
    (0.027, -0.020, -0.001, -10.0, 12.0),
    (0.022, -0.034, 0.008, -32.0, -8.0),
)
"""Of each ring: forward, left, up from the tip at the start (m); its axis' turn to the left and
its rise (degrees), in the order in which they are visited."""

_SIDES = 16
_WIRE_RADIUS = 0.0006
_POST_RADIUS = 0.0009
_PLATE_DEPTH = 0.034
"""Of the plate's upper face below the tip at the start, m."""
_WIRE: Colour = (70, 78, 96)
_POST: Colour = (120, 126, 138)
_PLATE: Colour = (64, 72, 88)


def ring_rotation(here: Place, yaw_deg: float, rise_deg: float) -> np.ndarray:
    """Frame (3, 3) of a ring: z its axis, x as far up as can be, y to the right."""
    yaw, rise = math.radians(yaw_deg), math.radians(rise_deg)
    z = np.array([math.cos(rise) * math.cos(yaw), math.cos(rise) * math.sin(yaw), math.sin(rise)])
    axis = here.heading @ z
    x = np.array([0.0, 0.0, 1.0]) - axis[2] * axis
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _parts(number: int, centre: np.ndarray, rotation: np.ndarray) -> list[Solid]:
    radius = (CLEAR_RADIUS + _WIRE_RADIUS) / math.cos(math.pi / _SIDES)
    angles = (np.arange(_SIDES + 1) + 0.5) * (2.0 * math.pi / _SIDES)
    around = radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_SIDES + 1)])
    corners = centre + around @ rotation.T
    return [
        bar(f"ring {number} part {index + 1}", corners[index], corners[index + 1], _WIRE_RADIUS,
            _WIRE, friction=0.2)
        for index in range(_SIDES)
    ]  # fmt: skip


def ring_board(configuration: Configuration) -> Board:
    """The rings of :data:`POSES` on posts, and a plate under them."""
    here = place(configuration)
    places = np.array([pose[:3] for pose in POSES])
    low, high = places.min(axis=0), places.max(axis=0)
    middle = 0.5 * (low + high)
    top = here.at(middle[0], middle[1], -_PLATE_DEPTH)
    half = (0.5 * float(high[0] - low[0]) + 0.012, 0.5 * float(high[1] - low[1]) + 0.012)
    solids: list[Solid] = [plate("plate", top, half, 0.006, here.heading, _PLATE)]
    rings: list[Ring] = []
    outer = (CLEAR_RADIUS + _WIRE_RADIUS) / math.cos(math.pi / _SIDES)
    for number, (forward, left, up, yaw_deg, rise_deg) in enumerate(POSES, 1):
        centre = here.at(forward, left, up)
        rotation = ring_rotation(here, yaw_deg, rise_deg)
        parts = _parts(number, centre, rotation)
        first = len(solids)
        rings.append(
            Ring(
                centre=fixed(centre),
                axis=fixed(rotation[:, 2]),
                clear_radius=CLEAR_RADIUS,
                solids=tuple(range(first, first + len(parts))),
            )
        )
        lowest = centre - (outer + _POST_RADIUS) * rotation[:, 0]
        foot = np.array([*lowest[:2], top[2]])
        solids += parts
        solids.append(bar(f"post {number}", foot, lowest, _POST_RADIUS, _POST))
    return Board("ring-board", "Ring board: six rings, 8.1 mm clear", tuple(solids), tuple(rings))
