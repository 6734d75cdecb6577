"""How near arm, module, shaft and body wall are to each other, from what was measured.

The links are capsules between the origins of their joints, the module is one along the flange's z
axis, the body wall is a round plate about the trocar, and the base stands on a table at z = 0. A
capsule is a little larger than what it stands for, so that the distances are on the safe side.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from robot.compiled import compiled
from robot.instrument import project_on_shaft, shaft
from robot.records import RecordFields

EVERY_TICKS = 10
"""How often distances are measured: at 500 Hz and the joints' speed limit, every 20 mm or less."""


class Part(IntEnum):
    """Which pair is nearest."""

    NONE = 0
    MODULE_WALL = 1
    ARM_WALL = 2
    SHAFT_ARM = 3
    MODULE_ARM = 4
    ARM_TABLE = 5


PART_NAMES = {
    Part.NONE: "nothing",
    Part.MODULE_WALL: "the instrument module and the body wall",
    Part.ARM_WALL: "the arm and the body wall",
    Part.SHAFT_ARM: "the shaft and the arm",
    Part.MODULE_ARM: "the instrument module and the arm",
    Part.ARM_TABLE: "the arm and the table",
}

_MODULE_WALL, _ARM_WALL, _SHAFT_ARM, _MODULE_ARM, _ARM_TABLE = 1, 2, 3, 4, 5
_FIRST_MOVING_LINK = 3
_FIRST_LINK_AT_WALL = 4
_LINKS_NEAR_SHAFT = 5
_LINKS_NEAR_MODULE = 4
_SAMPLES = 5


@compiled
def segment_distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Smallest distance between the straight lines from a to b and from c to d, each (3,), m."""
    u, v, w = b - a, d - c, a - c
    uu, uv, vv = float(u @ u), float(u @ v), float(v @ v)
    uw, vw = float(u @ w), float(v @ w)
    determinant = uu * vv - uv * uv
    s = 0.0
    if determinant > 1e-12 * uu * vv and uu > 0.0:
        s = min(max((uv * vw - vv * uw) / determinant, 0.0), 1.0)
    t = (uv * s + vw) / vv if vv > 0.0 else 0.0
    if t < 0.0 or t > 1.0 or vv == 0.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((uv * t - uw) / uu, 0.0), 1.0) if uu > 0.0 else 0.0
    square = 0.0
    for k in range(3):
        square += (w[k] + s * u[k] - t * v[k]) ** 2
    return math.sqrt(square)


@compiled
def wall_distance(point: np.ndarray, centre: np.ndarray, p: RecordFields) -> float:
    """Distance of a point (3,) from the body wall about ``centre`` (3,); negative inside, m."""
    height, square = 0.0, 0.0
    for k in range(3):
        away = point[k] - centre[k]
        height += away * p.wall_normal[k]
        square += away * away
    aside = math.sqrt(max(square - height * height, 0.0)) - p.wall_radius
    height -= 0.5 * p.wall_thickness
    return height if aside <= 0.0 else math.hypot(aside, height)


@compiled
def _capsule_to_wall(
    a: np.ndarray, b: np.ndarray, radius: float, centre: np.ndarray, p: RecordFields
) -> float:
    nearest = math.inf
    for step in range(_SAMPLES):
        point = a + step / (_SAMPLES - 1) * (b - a)
        nearest = min(nearest, wall_distance(point, centre, p))
    return nearest - radius


@compiled
def measure_clearance(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    joints: np.ndarray,
    flange_rotation: np.ndarray,
    parameters: np.ndarray,
) -> None:
    """Fill ``clearance``, ``clearance_part`` and ``trocar_distance`` of the state.

    Args:
        outcome: (1,) record whose ``state`` is changed.
        tick_input: (1,) with the trocar.
        joints: (8, 3) where the base and the joints were measured, base frame, m; the last is the
            flange.
        flange_rotation: (3, 3) the flange's orientation in the base frame.
        parameters: (1,) parameters.
    """
    s = outcome[0].state
    p = parameters[0]
    trocar = tick_input[0].trocar_position
    base, end, rotation = np.empty(3), np.empty(3), np.empty((3, 3))
    shaft(joints[7], flange_rotation, parameters, base, end, rotation)
    s.trocar_distance = project_on_shaft(trocar, base, end)[1]
    top = joints[7] + p.module_radius * flange_rotation[:, 2]
    bottom = joints[7] + max(p.shaft_base[2], p.module_radius) * flange_rotation[:, 2]
    nearest = _capsule_to_wall(top, bottom, p.module_radius, trocar, p)
    part = _MODULE_WALL
    for link in range(7):
        a, b, radius = joints[link], joints[link + 1], p.link_radius[link]
        if link >= _FIRST_LINK_AT_WALL:
            distance = _capsule_to_wall(a, b, radius, trocar, p)
            if distance < nearest:
                nearest, part = distance, _ARM_WALL
        if link >= _FIRST_MOVING_LINK:
            distance = min(a[2], b[2]) - radius
            if distance < nearest:
                nearest, part = distance, _ARM_TABLE
        if link < _LINKS_NEAR_SHAFT:
            distance = segment_distance(a, b, base, end) - radius
            if distance < nearest:
                nearest, part = distance, _SHAFT_ARM
        if link < _LINKS_NEAR_MODULE:
            distance = segment_distance(a, b, top, bottom) - radius - p.module_radius
            if distance < nearest:
                nearest, part = distance, _MODULE_ARM
    s.clearance, s.clearance_part = nearest, part
