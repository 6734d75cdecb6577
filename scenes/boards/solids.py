"""What boards are made of: solids, rings, a groove, a ball. All in the base frame, m and kg."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robot.rotations import quaternion_from_matrix

Kind = Literal["capsule", "sphere", "box", "cylinder"]
Colour = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Solid:
    """A rigid body that stands still.

    Attributes:
        name: unique on its board.
        kind: its shape.
        position: (3,) of its centre, m.
        wxyz: (4,) its orientation.
        size: (3,) in m. Capsule and cylinder: radius and half length along the solid's own z (a
            capsule's without its caps); sphere: radius; box: half edges. What is not used is 0.
        rgb: its colour, 0 to 255.
        collides: whether it can be touched; otherwise it is only drawn.
        friction: sliding friction coefficient.
    """

    name: str
    kind: Kind
    position: np.ndarray
    wxyz: np.ndarray
    size: np.ndarray
    rgb: Colour
    collides: bool = True
    friction: float = 0.3


@dataclass(frozen=True, eq=False)
class Ring:
    """A ring that the tip shall go through.

    Attributes:
        centre: (3,) m.
        axis: (3,) unit vector in which the tip goes through.
        clear_radius: of the opening, m.
        solids: places of its parts in the board's solids.
    """

    centre: np.ndarray
    axis: np.ndarray
    clear_radius: float
    solids: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Groove:
    """A groove that guides a ball.

    Attributes:
        centre_line: (n, 3) where the ball's centre goes, start to end, m.
    """

    centre_line: np.ndarray


@dataclass(frozen=True, eq=False)
class Ball:
    """A ball that can roll.

    Attributes:
        position: (3,) of its centre at rest, m.
        radius: m.
        mass_kg: kg.
        friction: sliding friction coefficient.
        rolling_friction: lever of the rolling resistance, m.
    """

    position: np.ndarray
    radius: float
    mass_kg: float
    friction: float
    rolling_friction: float


@dataclass(frozen=True, eq=False)
class Board:
    """Everything that stands in front of the instrument.

    Attributes:
        name: as in the configuration.
        title: for people.
        solids: what stands still.
        rings: what the tip shall go through.
        groove: where the ball goes, if there is one.
        ball: the ball, if there is one.
    """

    name: str
    title: str
    solids: tuple[Solid, ...] = ()
    rings: tuple[Ring, ...] = ()
    groove: Groove | None = None
    ball: Ball | None = None


def fixed(values: object) -> np.ndarray:
    """A read-only array of floats."""
    array = np.array(values, dtype=float)
    array.flags.writeable = False
    return array


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Quaternion (4,) wxyz of a rotation matrix (3, 3), read-only."""
    wxyz = np.empty(4)
    quaternion_from_matrix(np.ascontiguousarray(rotation), wxyz)
    return fixed(wxyz)


def rotation_to(axis: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) whose z is the unit ``axis`` (3,)."""
    sideways = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = sideways - (sideways @ axis) * axis
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def bar(
    name: str,
    start: np.ndarray,
    end: np.ndarray,
    radius: float,
    rgb: Colour,
    friction: float = 0.3,
    kind: Literal["capsule", "cylinder"] = "capsule",
) -> Solid:
    """A capsule or cylinder whose axis goes from ``start`` (3,) to ``end`` (3,), m."""
    along = end - start
    length = float(np.linalg.norm(along))
    return Solid(
        name=name,
        kind=kind,
        position=fixed(0.5 * (start + end)),
        wxyz=quaternion(rotation_to(along / length)),
        size=fixed([radius, 0.5 * length, 0.0]),
        rgb=rgb,
        friction=friction,
    )


def plate(
    name: str,
    top: np.ndarray,
    half_size: tuple[float, float],
    thickness: float,
    rotation: np.ndarray,
    rgb: Colour,
    friction: float = 0.3,
) -> Solid:
    """A flat box.

    Args:
        name: of the solid.
        top: (3,) middle of its upper face, m.
        half_size: half edges along its own x and y, m.
        thickness: m.
        rotation: (3, 3) its orientation; its z is the normal of the upper face.
        rgb: colour.
        friction: sliding friction coefficient.
    """
    return Solid(
        name=name,
        kind="box",
        position=fixed(top - 0.5 * thickness * rotation[:, 2]),
        wxyz=quaternion(rotation),
        size=fixed([*half_size, 0.5 * thickness]),
        rgb=rgb,
        friction=friction,
    )
