"""The shape of one arm, for drawing: frames along its backbone and where each tube is.

Base frame as in :mod:`robot.concentric.kinematics`: origin at the channel's exit, z out of it.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.concentric.sections import advance, pass_place, places
from robot.concentric.state import state_at_exit


@compiled
def tube_extents(q: np.ndarray, tubes: np.ndarray) -> np.ndarray:
    """Where each tube is in front of the exit.

    Args:
        q: (2n,) translations in m, rotations in rad.
        tubes: (n,) ``TUBE``.

    Returns:
        (n, 3) arc lengths in m, from the exit: of its rear end (not above 0: in the channel), of
        the place where it begins to curve, of its tip; the last two not below 0.
    """
    extents = np.empty((len(tubes), 3))
    for index in range(len(tubes)):
        extents[index, 0] = q[index]
        extents[index, 1] = max(q[index] + tubes[index]["straight_length"], 0.0)
        extents[index, 2] = max(q[index] + tubes[index]["length"], 0.0)
    return extents


@compiled
def backbone(
    q: np.ndarray,
    torsion: np.ndarray,
    tubes: np.ndarray,
    arc: np.ndarray,
    positions: np.ndarray,
    rotations: np.ndarray,
) -> None:
    """Frames of the innermost tube along the arm.

    Args:
        q: (2n,) translations in m, rotations in rad.
        torsion: (n,) torsion rates at the exit that ``solve_arm`` found for ``q``, rad/m.
        tubes: (n,) ``TUBE``.
        arc: (m,) arc lengths from the exit in m, ascending; below 0 and beyond the tip they count
            as 0 and as the tip.
        positions: (m, 3) filled, m.
        rotations: (m, 3, 3) filled.
    """
    count = len(tubes)
    state = state_at_exit(q, torsion)
    stops, which = places(q, tubes)
    here, passed = 0.0, 0
    for point in range(len(arc)):
        goal = min(max(arc[point], here), stops[2 * count - 1])
        while passed < 2 * count - 1 and stops[passed] <= goal:
            if stops[passed] > here:
                advance(state, stops[passed] - here, 3 * count, True)
                here = stops[passed]
            pass_place(state, which[passed], here > 0.0, tubes, 1.0, False)
            passed += 1
        if goal > here:
            advance(state, goal - here, 3 * count, True)
            here = goal
        cosine, sine = math.cos(state.angle[0]), math.sin(state.angle[0])
        for row in range(3):
            x, y = state.rotation[row, 0], state.rotation[row, 1]
            positions[point, row] = state.position[row]
            rotations[point, row, 0] = cosine * x + sine * y
            rotations[point, row, 1] = cosine * y - sine * x
            rotations[point, row, 2] = state.rotation[row, 2]
