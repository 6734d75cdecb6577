"""The experiments, by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.rotations import exponential, quaternion_from_matrix
from robot.start import start_tip_rotation
from scenes.path import Path

_SAMPLES_PER_SECOND = 100
_CIRCLE_RADIUS_M = 0.015
_SQUARE_SIDE_M = 0.023
_SWEEP_RAD = math.radians(40.0)


@dataclass(frozen=True)
class Experiment:
    """A path with a name.

    Attributes:
        name: as on the command line.
        title: for people.
        path: what the tip shall do.
    """

    name: str
    title: str
    path: Path

    @property
    def duration_s(self) -> float:
        """Length of the path in s."""
        return self.path.duration_s


def _times(duration_s: float) -> np.ndarray:
    return np.linspace(0.0, duration_s, round(duration_s * _SAMPLES_PER_SECOND) + 1)


def _still(times: np.ndarray) -> np.ndarray:
    samples = np.zeros((len(times), 8))
    samples[:, 0] = times
    samples[:, 4] = 1.0
    return samples


def _circle(duration_s: float, first: int, second: int) -> np.ndarray:
    """A 3 cm circle through the start, in the plane of two base axes."""
    samples = _still(_times(duration_s))
    angle = 2.0 * math.pi * samples[:, 0] / duration_s
    samples[:, 1 + first] = _CIRCLE_RADIUS_M * (np.cos(angle) - 1.0)
    samples[:, 1 + second] = _CIRCLE_RADIUS_M * np.sin(angle)
    return samples


def _square(side_s: float) -> np.ndarray:
    """A square in the base's x-y plane; speed comes from rest and goes to rest on every side."""
    corners = _SQUARE_SIDE_M * np.array([[0, 0], [-1, 0], [-1, 1], [0, 1], [0, 0]], dtype=float)
    samples = _still(_times(4 * side_s))
    side = np.minimum((samples[:, 0] // side_s).astype(int), 3)
    share = samples[:, 0] / side_s - side
    smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    samples[:, 1:3] = corners[side] + smooth[:, None] * (corners[side + 1] - corners[side])
    return samples


def _circle_infeasible(configuration: Configuration) -> np.ndarray:
    """The circle in 8 s while the tip shall also turn 40 degrees about its own y axis and back."""
    samples = _circle(8.0, 0, 1)
    start = start_tip_rotation(configuration)
    turn, own = np.empty((3, 3)), np.empty(4)
    for row in samples:
        angle = 0.5 * _SWEEP_RAD * (1.0 - math.cos(2.0 * math.pi * row[0] / 8.0))
        exponential(np.array([0.0, angle, 0.0]), turn)
        quaternion_from_matrix(start @ turn @ start.T, own)
        row[4:8] = own
    return samples


_EXPERIMENTS: dict[str, tuple[str, Callable[[Configuration], np.ndarray]]] = {
    "circle": ("3 cm circle about z, 20 s", lambda _: _circle(20.0, 0, 1)),
    "circle-yz": ("3 cm circle in the y-z plane, 20 s", lambda _: _circle(20.0, 2, 1)),
    "square": ("square of 23 mm sides, 10 s a side", lambda _: _square(10.0)),
    "circle-infeasible": (
        "3 cm circle in 8 s while the orientation goes 40 deg past a 60 deg bend and back",
        _circle_infeasible,
    ),
}


def names() -> tuple[str, ...]:
    """The names that :func:`experiment` knows."""
    return tuple(_EXPERIMENTS)


def experiment(name: str, configuration: Configuration) -> Experiment:
    """The experiment called ``name``; raises :class:`robot.errors.UnknownName`."""
    if name not in _EXPERIMENTS:
        raise UnknownName("experiment", name, names())
    title, samples = _EXPERIMENTS[name]
    return Experiment(name, title, Path(samples(configuration), name))
