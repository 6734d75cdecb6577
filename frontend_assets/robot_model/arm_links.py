"""The arm's eight links, modelled on the outlines of a UFACTORY xArm 7 [mm, each link's frame].

Every joint ends in a flat round face a little short of the joint plane, so that a thin groove with
a dark bottom runs round the arm where two links meet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from frontend_assets.robot_model.fields import (
    above,
    common,
    drum,
    limb,
    melt,
    stretched,
    union,
)
from frontend_assets.robot_model.shells import Shell, joined
from frontend_assets.robot_model.solids import (
    ROUND,
    SMALL,
    bevelled_rod,
    block,
    merged,
    ring,
    rod,
    shell_of,
)
from frontend_assets.robot_model.surface import Cut, moulded

Triple = tuple[float, float, float]
Parts = dict[str, Shell]
"""Material name (``shell``, ``dark``, ``metal``) to the mesh that has it."""

GAP = 0.7
"""Half of the groove between two links [mm]."""
DEPTH = 1.2
"""How far the groove's dark bottom lies below the surface [mm]."""
CELL = 6.0
"""Size of the triangles on the round bodies [mm]."""


def arm_links() -> tuple[Parts, ...]:
    """The links from the base to the flange side."""
    builders: tuple[Callable[[], Parts], ...] = (
        _base, _link1, _link2, _link3, _link4, _link5, _link6, _link7,
    )  # fmt: skip
    return tuple(build() for build in builders)


def _base() -> Parts:
    tube = bevelled_rod((0, 0, 10), (0, 0, 155 - GAP), 48, 0.8, 64)
    plate = bevelled_rod((0, 0, 0), (0, 0, 13), 63, 1.5, 64)
    socket = block((-60, -17, 12), (-30, 17, 62), 4)
    bolts, wells = [], []
    for turn in np.radians([45, 135, 225, 315]):
        x, y = 55.5 * np.cos(turn), 55.5 * np.sin(turn)
        wells.append(rod((x, y, 9), (x, y, 14), 4.6, 24))
        bolts.append(bevelled_rod((x, y, 8), (x, y, 12.4), 3.6, 0.5, 24))
    shell = merged([tube, plate, socket]) - merged(wells)
    metal = [shell_of(bolt) for bolt in bolts]
    for start, end, radius, facets in (
        (-66, -58, 11.5, 6), (-72, -66, 9.5, 24), (-76, -72, 11.5, 24), (-88, -76, 9, 24),
        (-92, -88, 7, 24),
    ):  # fmt: skip
        metal.append(shell_of(bevelled_rod((start, 0, 44), (end, 0, 44), radius, 0.8, facets)))
    dark = [
        _groove((0, 0, 155), (0, 0, 1), 48),
        *_plugs(((0, 48, 136), (0, 1, 0)), ((0, -48, 136), (0, -1, 0))),
    ]
    return {"shell": shell_of(shell), "dark": joined(dark), "metal": joined(metal)}


def _link1() -> Parts:
    column = limb([(0, 0, -150), (0, 0, -95), (0, -3, -70), (0, -8, -30)], [48, 48, 46, 42])
    shoulder = drum((0, -55, 0), (0, 60, 0), 47.5, 30)
    cuts = [_cut((0, 0, -112), (0, 0, -1), 60), _cut((0, 18, 0), (0, 1, 0), 49.5)]
    shell = moulded(melt(column, shoulder, 24), (-60, -70, -140), (60, 62, 60), cuts, CELL)
    hub = shell_of(rod((0, 10, 0), (0, 75, 0), 30, 32))
    groove = _groove((0, 18, 0), (0, 1, 0), 47.5)
    return {"shell": shell, "dark": joined([groove, hub])}


def _link2() -> Parts:
    stub = drum((0, 0, 0), (0, 0, 78), 46.8, 5)
    lobe = drum((0, -240, 0), (0, -66, 0), 42, 30)
    bridge = limb([(0, -110, 0), (0, -112, 40), (0, -112, 74)], [34, 37, 39])
    body = stretched(limb([(0, -112, 74), (0, 0, 74)], [44.5, 46.5]), (0, 0, 74), (1, 1, 0.96))
    handle = common(body, above((0, 0, 73), (0, 0, 1)), 10)
    grip = melt(melt(lobe, bridge, 14), handle, 16)
    cuts = [_cut((0, 0, 18), (0, 0, -1), 50), _cut((0, -192, 0), (0, -1, 0), 60)]
    field = melt(grip, stub, 9)
    shell = moulded(field, (-60, -215, -60), (60, 60, 130), cuts, CELL)
    dark = [
        _groove((0, -192, 0), (0, -1, 0), 42),
        *_plugs(((42, -177, 0), (1, 0, 0)), ((-42, -177, 0), (-1, 0, 0))),
    ]
    return {"shell": shell, "dark": joined(dark)}


def _link3() -> Parts:
    column = limb([(0, 0, -140), (0, 0, -66), (6, 8, -32), (26, 18, -10)], [42, 42, 40, 36])
    barrel = drum((52.5, -110, 0), (52.5, 69, 0), 42.5, 34)
    elbow = limb([(4, 20, -22), (30, 24, -4), (52, 24, 0)], [35, 39, 40])
    field = melt(melt(column, barrel, 34), elbow, 10)
    cuts = [_cut((0, 0, -101), (0, 0, -1), 60), _cut((52.5, -67, 0), (0, -1, 0), 60)]
    shell = moulded(field, (-55, -85, -120), (108, 82, 56), cuts, CELL)
    dark = [_groove((52.5, -67, 0), (0, -1, 0), 42.5), *_plugs(((82.55, -52, 30.05), (1, 0, 1)))]
    return {"shell": shell, "dark": joined(dark)}


def _link4() -> Parts:
    dome = limb([(0, 0, 64), (40, -44, 65), (77, -92, 64)], [42.5, 38, 41])
    handle = common(dome, above((0, 0, 67 + GAP), (0, 0, 1)), 6)
    bridge = limb([(77.5, -94, 0), (77, -93, 32), (77, -93, 64)], [34, 38, 41])
    lobe = drum((77.5, -220, 0), (77.5, -52, 0), 42.3, 30)
    field = melt(melt(lobe, bridge, 12), handle, 18)
    cuts = [_cut((77.5, -169, 0), (0, -1, 0), 60)]
    shell = moulded(field, (-56, -200, -56), (132, 56, 120), cuts, CELL)
    dark = [_groove((77.5, -169, 0), (0, -1, 0), 42.3), *_plugs(((107.4, -154, -29.9), (1, 0, -1)))]
    return {"shell": shell, "dark": joined(dark)}


def _link5() -> Parts:
    lobe = drum((0, 0, -220), (0, 0, -118), 42, 26)
    line = [(0, 4, -152), (0, 26, -122), (0, 43, -84), (0, 48.5, -40), (0, 48.5, 0)]
    neck = limb(line, [26, 33, 35.5, 36, 36.5])
    hollow = union(above((0, 45, 0), (0, 1, 0)), above((0, 0, -88), (0, 1, -1)))
    inside = common(neck, hollow, 14)
    stub = drum((0, 10, 0), (0, 50, 0), 36.8, 3)
    field = melt(melt(lobe, inside, 26), stub, 8)
    cuts = [_cut((0, 0, -173), (0, 0, -1), 60)]
    shell = moulded(field, (-55, -55, -200), (55, 98, 50), cuts, CELL)
    dark = [_groove((0, 37, 0), (0, -1, 0), 36.8)]
    return {"shell": shell, "dark": joined(dark)}


def _link6() -> Parts:
    barrel = drum((0, 0, -70), (0, 0, 58), 37, 13)
    column = drum((76, -38, 0), (76, 120, 0), 37, 14)
    bridge = limb([(8, 0, 8), (76, 3, 4)], [34, 33])
    field = melt(melt(barrel, column, 16), bridge, 14)
    cuts = [_cut((0, 0, -37), (0, 0, -1), 60), _cut((76, 69, 0), (0, 1, 0), 60)]
    shell = moulded(field, (-50, -50, -55), (126, 85, 70), cuts, 5.0)
    badge = _engraved_ring((0, 0, 57.7), (0, 0, 1), 21, 20)
    dark = [_groove((76, 69, 0), (0, 1, 0), 37), badge]
    dark += _plugs(((102.2, 56, 26.2), (1, 0, 1)), ((102.2, 56, -26.2), (1, 0, -1)))
    return {"shell": shell, "dark": joined(dark)}


def _link7() -> Parts:
    body = bevelled_rod((0, 0, -28 + GAP), (0, 0, -0.2), 37, 0.6, 64)
    nut = bevelled_rod((0, -34, -13), (0, -42, -13), 9.5, 0.8, 6)
    plug = bevelled_rod((0, -40, -13), (0, -52, -13), 6.5, 0.8, 24)
    metal = joined([shell_of(nut), shell_of(plug)])
    return {
        "shell": shell_of(body),
        "dark": joined(_plugs(((37, 0, -14), (1, 0, 0)))),
        "metal": metal,
    }


def _cut(
    point: Triple,
    normal: Triple,
    radius: float,
    reach: float = 200.0,
) -> Cut:
    x, y, z = np.array(point, float) - GAP * np.array(normal)
    return Cut((float(x), float(y), float(z)), normal, radius, reach)


def _groove(point: Triple, normal: Triple, radius: float) -> Shell:
    """The dark bottom of the groove between this link and the next."""
    middle, over = np.array(point, float), 3 * GAP * np.array(normal, float)
    return shell_of(rod(middle - over, middle + over, radius - DEPTH, ROUND))


def _plugs(*places: tuple[Triple, Triple]) -> list[Shell]:
    """Screw holes as dark discs: a point on the surface and the surface's outward direction."""
    plugs = []
    for point, outward in places:
        axis = np.array(outward, float) / np.linalg.norm(outward)
        middle = np.array(point, float)
        plugs.append(shell_of(rod(middle - 2 * axis, middle + 0.35 * axis, 3.2, 2 * SMALL)))
    return plugs


def _engraved_ring(
    point: Sequence[float], normal: Sequence[float], outer: float, inner: float
) -> Shell:
    start, over = np.array(point, float), 0.6 * np.array(normal, float)
    return shell_of(ring(start, start + over, outer, inner, 6))
