"""The tip pushes a ball along a groove (paper, section 5.4, Fig. 13)."""

from __future__ import annotations

import numpy as np

from robot.configuration import Configuration
from scenes.boards.place import Place, place
from scenes.boards.silicon import ARC_HEADING, LENGTHS, SLACK, behind_ball
from scenes.experiments.timing import cruise, minimum_jerk, still, times

DURATION_S = 20.0

_TURN_S = 4.0
"""The arc begins across the tip's heading: it turns on the spot first."""
_REST_S = 0.5
_RAMP = 0.15
_BEYOND_M = 0.001
"""The ball is pushed past the end of the groove's centre line by this much."""


def _progress(name: str, instants: np.ndarray, begin_s: float) -> np.ndarray:
    """Where in the groove the ball shall be pushed to (n,): from the slack to beyond the end."""
    share = (instants - begin_s) / (DURATION_S - _REST_S - begin_s)
    first, last = -SLACK / LENGTHS[name], 1.0 + _BEYOND_M / LENGTHS[name]
    return first + (last - first) * cruise(share, _RAMP)


def _samples(here: Place, instants: np.ndarray, end: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Samples (n, 8) of the tip.

    Args:
        here: the start.
        instants: (n,) s.
        end: (n, 3) centre of the tip's rounded end, base frame, m.
        turn: (n,) of the tip about the vertical, rad.
    """
    samples = still(instants)
    samples[:, 4], samples[:, 7] = np.cos(0.5 * turn), np.sin(0.5 * turn)
    x, y, z = here.tip_rotation[:, 2]
    direction = np.column_stack(
        [
            np.cos(turn) * x - np.sin(turn) * y,
            np.sin(turn) * x + np.cos(turn) * y,
            np.full(len(turn), z),
        ]
    )
    samples[:, 1:4] = end + here.tip_radius * direction - here.tip
    return samples


def silicon_sine(configuration: Configuration) -> np.ndarray:
    """Along the sine, the tip's orientation kept: samples (n, 8)."""
    here, instants = place(configuration), times(DURATION_S)
    end = behind_ball("silicon-sine", here, _progress("silicon-sine", instants, 0.0))
    return _samples(here, instants, end, np.zeros(len(instants)))


def silicon_arc(configuration: Configuration) -> np.ndarray:
    """Along the arc, the tip turning with its tangent: samples (n, 8)."""
    here, instants = place(configuration), times(DURATION_S)
    along = _progress("silicon-arc", instants, _TURN_S)
    end = behind_ball("silicon-arc", here, along)
    heading = ARC_HEADING * (2.0 * np.clip(along, 0.0, 1.0) - 1.0)
    turn = np.where(instants < _TURN_S, -ARC_HEADING * minimum_jerk(instants / _TURN_S), heading)
    return _samples(here, instants, end, turn)
