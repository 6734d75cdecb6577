"""A silicon board with a groove, and the ball that the tip pushes along it.

The groove's walls are two low rails: the instrument passes over them, the ball cannot. The tip
pushes from behind and a little above the ball's middle, with its rounded end; where that end's
centre has to be for the ball to be at a point of the groove is :func:`behind_ball`.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from robot.configuration import Configuration
from scenes.boards.place import Place, place
from scenes.boards.solids import Ball, Board, Colour, Groove, Solid, bar, fixed, plate

BALL_RADIUS = 0.005
SINE_LENGTH = 0.050
SINE_AMPLITUDE = 0.003
ARC_RADIUS = 0.020
ARC_HEADING = math.radians(45.0)
"""The arc's tangent turns from minus this to this, about the tip's heading at the start."""
SLACK = 0.0015
"""Between tip and ball at the start, m."""
RUN_OUT = 0.010
"""The groove goes on beyond the end of its centre line, m."""

_LIFT = 0.0015
"""Height of the middle of the tip's rounded end over the middle of the ball, m."""
_RAIL_RADIUS = 0.0008
_RAIL_HEIGHT = 0.0022
"""Of the rails' axes over the floor, m."""
_PLAY = 0.0002
"""Of the ball between the rails, to either side, m."""
_RAIL_PIECE = 0.0025
_LEAD_IN = 0.0025
_BORDER = np.array([[-0.0045, -0.014], [0.016, 0.014]])
"""Of the board around the centre line, m: near the start it ends short of where the segment passes
when it straightens."""
_POINTS = 201
_SILICON: Colour = (226, 196, 178)
_RAIL: Colour = (176, 120, 100)


def reach(here: Place) -> float:
    """Level distance from the tip's rounded end (its centre) to a ball that it touches, m."""
    return math.sqrt((BALL_RADIUS + here.tip_radius) ** 2 - _LIFT**2)


def sine_line(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The sine groove.

    Args:
        along: (n,) progress from 0 to 1; outside, the line goes on straight.

    Returns:
        Points (n, 2) in m from the groove's start and unit tangents (n, 2), level frame.
    """
    inside = np.clip(along, 0.0, 1.0)
    phase = 2.0 * math.pi * inside
    slope = SINE_AMPLITUDE * 2.0 * math.pi / SINE_LENGTH * np.cos(phase)
    tangents = np.column_stack([np.ones_like(slope), slope])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    points = np.column_stack([SINE_LENGTH * inside, SINE_AMPLITUDE * np.sin(phase)])
    return points + (SINE_LENGTH * (along - inside))[:, None] * tangents, tangents


def arc_line(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The arc groove; arguments and results as of :func:`sine_line`."""
    inside = np.clip(along, 0.0, 1.0)
    heading = ARC_HEADING * (2.0 * inside - 1.0)
    tangents = np.column_stack([np.cos(heading), np.sin(heading)])
    points = ARC_RADIUS * np.column_stack(
        [np.sin(heading) + math.sin(ARC_HEADING), math.cos(ARC_HEADING) - np.cos(heading)]
    )
    length = 2.0 * ARC_HEADING * ARC_RADIUS
    return points + (length * (along - inside))[:, None] * tangents, tangents


LINES = {"silicon-sine": sine_line, "silicon-arc": arc_line}
LENGTHS = {"silicon-sine": SINE_LENGTH, "silicon-arc": 2.0 * ARC_HEADING * ARC_RADIUS}
"""Metres per unit of progress: along x for the sine, along the line for the arc."""


def groove_start(name: str, here: Place) -> np.ndarray:
    """(3,) where the ball's centre rests at the start, base frame, m."""
    tangent = LINES[name](np.zeros(1))[1][0]
    ahead = (reach(here) + SLACK) * tangent
    start: np.ndarray = here.hemisphere + here.heading @ np.array([*ahead, -_LIFT])
    return start


def behind_ball(name: str, here: Place, along: np.ndarray) -> np.ndarray:
    """Centre of the tip's rounded end when it touches a ball in the groove from behind.

    Args:
        name: of the board.
        here: where it stands.
        along: (n,) progress of the ball.

    Returns:
        (n, 3) base frame, m.
    """
    points, tangents = LINES[name](along)
    level = points - reach(here) * tangents
    centre = np.column_stack([level, np.full(len(level), _LIFT)])
    found: np.ndarray = groove_start(name, here) + centre @ here.heading.T
    return found


def _rails(name: str, here: Place, start: np.ndarray) -> list[Solid]:
    length = LENGTHS[name]
    pieces = math.ceil((length + _LEAD_IN + RUN_OUT) / _RAIL_PIECE)
    along = np.linspace(-_LEAD_IN / length, 1.0 + RUN_OUT / length, pieces + 1)
    points, tangents = LINES[name](along)
    normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
    drop = BALL_RADIUS - _RAIL_HEIGHT
    half_width = math.sqrt((BALL_RADIUS + _RAIL_RADIUS) ** 2 - drop**2) + _PLAY
    solids: list[Solid] = []
    ends = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        level = np.column_stack([points + sign * half_width * normals, np.full(pieces + 1, -drop)])
        corners = start + level @ here.heading.T
        ends.append(corners[-1])
        solids += [
            bar(f"{side} rail {index + 1}", one, following, _RAIL_RADIUS, _RAIL, friction=0.1)
            for index, (one, following) in enumerate(itertools.pairwise(corners))
        ]
    solids.append(bar("end stop", ends[0], ends[1], _RAIL_RADIUS, _RAIL, friction=0.1))
    return solids


def silicon(name: str, title: str, configuration: Configuration) -> Board:
    """The board called ``name`` (a key of :data:`LINES`)."""
    here = place(configuration)
    start = groove_start(name, here)
    points, _ = LINES[name](np.linspace(0.0, 1.0, _POINTS))
    level = np.column_stack([points, np.zeros(_POINTS)])
    low, high = np.array([points.min(axis=0), points.max(axis=0)]) + _BORDER
    middle = np.array([*(0.5 * (low + high)), -BALL_RADIUS])
    half = 0.5 * (high - low)
    floor = plate(
        "floor",
        start + here.heading @ middle,
        (float(half[0]), float(half[1])),
        0.008,
        here.heading,
        _SILICON,
    )
    ball = Ball(
        position=fixed(start),
        radius=BALL_RADIUS,
        mass_kg=6e-4,
        friction=0.2,
        rolling_friction=1e-4,
    )
    return Board(
        name,
        title,
        (floor, *_rails(name, here, start)),
        groove=Groove(fixed(start + level @ here.heading.T)),
        ball=ball,
    )
