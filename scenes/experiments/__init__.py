"""The experiments, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robot.configuration import Configuration
from robot.errors import UnknownName
from scenes.experiments.bending import BENDING_S, arc, arc_stylus
from scenes.experiments.planar import circle, circle_infeasible, square
from scenes.experiments.pressing import press_times, ring_press
from scenes.experiments.pushing import silicon_arc, silicon_sine
from scenes.experiments.rings import half_way_times, ring_path
from scenes.path import Path


@dataclass(frozen=True)
class Experiment:
    """A path with a name, and what it is played on.

    Attributes:
        name: as on the command line.
        title: for people.
        path: what the tip shall do.
        board: name of the board it is made for; ``none`` where it needs none.
        needs_room: whether it would run into a board that stands there all the same.
        lock_arm: whether the arm stands still meanwhile.
        cases: the priority cases under which the paper runs it, by name.
        marks: times that matter, s. Rings: the tip is half-way through, one for each. Square: it
            is over the next peg. Arc: from here on the direction moves instead of the bend.
    """

    name: str
    title: str
    path: Path
    board: str = "none"
    lock_arm: bool = False
    cases: tuple[str, ...] = ("0", "1", "2")
    marks: tuple[float, ...] = ()
    needs_room: bool = False

    @property
    def duration_s(self) -> float:
        """Length of the path in s."""
        return self.path.duration_s


class _Plan(NamedTuple):
    title: str
    samples: Callable[[Configuration], np.ndarray]
    board: str = "none"
    lock_arm: bool = False
    cases: tuple[str, ...] = ("0", "1", "2")
    marks: Callable[[Configuration], tuple[float, ...]] = lambda _: ()
    needs_room: bool = False


_EXPERIMENTS = {
    "arc": _Plan(
        "arc of 5 cm by the segment alone, 12 s",
        arc,
        lock_arm=True,
        cases=("0",),
        marks=lambda _: (BENDING_S,),
        needs_room=True,
    ),
    "arc-stylus": _Plan(
        "the same arc as a stylus asks for it, 12 s",
        arc_stylus,
        lock_arm=True,
        cases=("0",),
        marks=lambda _: (BENDING_S,),
        needs_room=True,
    ),
    "circle": _Plan("3 cm circle about z, 20 s", lambda _: circle(20.0, 1.0, (-1.0, 0.0, 0.0), 1)),
    "circle-yz": _Plan(
        "3 cm circle in the y-z plane, 20 s",
        lambda _: circle(20.0, 1.0, (0.0, 0.0, 1.0), 1),
        cases=("0",),
    ),
    "square": _Plan(
        "square of 23 mm sides from peg to peg, 10 s a side",
        lambda _: square(10.0),
        board="pegboard",
        cases=("0",),
        marks=lambda _: (10.0, 20.0, 30.0, 40.0),
    ),
    "circle-infeasible": _Plan(
        "3 cm circle in 8 s while the orientation goes 40 deg past a 60 deg bend and back",
        circle_infeasible,
    ),
    "silicon-sine": _Plan(
        "a ball along a sine groove of 5 cm, 20 s", silicon_sine, "silicon-sine", cases=("1", "2")
    ),
    "silicon-arc": _Plan(
        "a ball along an arc groove of 2 cm radius, 20 s",
        silicon_arc,
        "silicon-arc",
        cases=("1", "2"),
    ),
    "ring-board": _Plan(
        "half-way through six rings, 12 s a ring", ring_path, "ring-board", marks=half_way_times
    ),
    "ring-press": _Plan(
        "against the side of a ring, five levels of force, 4 s a level",
        ring_press,
        "ring-board",
        cases=("1",),
        marks=press_times,
    ),
}


def names() -> tuple[str, ...]:
    """The names that :func:`experiment` knows."""
    return tuple(_EXPERIMENTS)


def experiment(name: str, configuration: Configuration) -> Experiment:
    """The experiment called ``name``; raises :class:`robot.errors.UnknownName`."""
    if name not in _EXPERIMENTS:
        raise UnknownName("experiment", name, names())
    plan = _EXPERIMENTS[name]
    return Experiment(
        name,
        plan.title,
        Path(plan.samples(configuration), name),
        plan.board,
        plan.lock_arm,
        plan.cases,
        plan.marks(configuration),
        plan.needs_room,
    )
