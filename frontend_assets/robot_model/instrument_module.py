"""The instrument module on the flange, its shaft, and a disk of the continuum segment [mm].

The module is modelled upright in the flange frame with the shaft leaving along x at the height of
the configured shaft base, then turned about the flange axis to where the shaft really leaves.
"""

from __future__ import annotations

import numpy as np

from frontend_assets.robot_model.fields import Array
from frontend_assets.robot_model.shells import Shell, joined
from frontend_assets.robot_model.solids import (
    SMALL,
    Solid,
    bevelled_rod,
    block,
    merged,
    moved,
    prism,
    ring,
    rod,
    shell_of,
)
from robot.configuration import Instrument, Module
from robot.urdf import shaft_rotation

SERVO = (46.5, 28.5, 34.0)
"""Outer size of a servo [mm]: along the radius, across, along the flange axis."""
SERVO_INNER = 14.5
"""Distance of a servo's inner face from the flange axis [mm]."""
HORN_RADIUS = SERVO_INNER + 14.0
"""Distance of the servos' output axes from the flange axis [mm]."""
SERVO_AZIMUTHS_DEG = (45.0, 135.0, 225.0, 315.0)

# Heights above the shaft's axis, toward the flange (the module hangs upside down in use).
_PLATE_BOTTOM, _PLATE_TOP = -15.0, -5.0
_DISC_BOTTOM, _DISC_TOP = 13.0, 18.0
_SERVO_BOTTOM = 24.0
_SERVO_TOP = _SERVO_BOTTOM + SERVO[2]
_FLANGE_RING, _FLANGE_PLATE = 9.0, 13.5


def instrument_module(module: Module) -> dict[str, Shell]:
    """Meshes by material (``ivory``, ``servo``, ``dark``, ``metal``) in the flange frame [mm]."""
    base = 1e3 * np.array(module.shaft_base_m)
    radius = 500 * max(module.adapter_size_m)
    turn = _azimuth(module)
    parts = {
        "ivory": [*_housing(base, radius, turn)],
        "servo": [
            _flange_ring(),
            *(_turned(_servo(base[2]), a + turn) for a in SERVO_AZIMUTHS_DEG),
        ],
        "dark": [],
        "metal": [],
    }
    for azimuth in SERVO_AZIMUTHS_DEG:
        for material, solids in (
            ("dark", [*_servo_holes(base[2]), *_pulley(base[2], 1e3 * module.pulley_radius_m)]),
            ("metal", _horn(base[2])),
        ):
            parts[material] += [_turned(solid, azimuth + turn) for solid in solids]
    parts["dark"] += _hub_holes(turn)
    parts["metal"] += [*_flange_screws(), *_bushing(module)]
    return {name: joined([shell_of(s) for s in solids]) for name, solids in parts.items()}


def shaft(instrument: Instrument) -> dict[str, Shell]:
    """The steel tube in the shaft frame, z along it [mm]."""
    length, radius = 1e3 * instrument.shaft_length_m, 500 * instrument.shaft_diameter_m
    tube = bevelled_rod((0, 0, 0), (0, 0, length), radius, 0.06 * radius, 32)
    return {"metal": shell_of(tube)}


def segment_disk(instrument: Instrument) -> Shell:
    """One disk of the continuum segment: centred on its axis z, bored, with four tendon holes.

    Its thickness is 0.45 of the pitch of the disks; tendon hole i stands at i quarter turns from x.
    """
    pitch = 1e3 * instrument.segment_length_m / instrument.disk_count
    half, radius = 0.225 * pitch, 500 * instrument.disk_diameter_m
    hole = max(500 * instrument.tendon_diameter_m * 2.0, 0.03 * radius)
    body = bevelled_rod((0, 0, -half), (0, 0, half), radius, 0.3 * half, 24)
    bore = min(0.3 * radius, 1e3 * instrument.tendon_pitch_radius_m - 2 * hole)
    holes = [rod((0, 0, -pitch), (0, 0, pitch), bore, SMALL)]
    for quarter in range(4):
        turn = np.pi / 2 * quarter
        place = 1e3 * instrument.tendon_pitch_radius_m * np.array([np.cos(turn), np.sin(turn), 0])
        over = np.array([0, 0, pitch])
        holes.append(rod(place - over, place + over, hole, 6))
    return shell_of(body - merged(holes))


def _azimuth(module: Module) -> float:
    """Where the shaft leaves, seen along the flange axis [deg]; 0 for a shaft along that axis."""
    x, y, _ = module.shaft_direction
    return float(np.degrees(np.arctan2(y, x))) if np.hypot(x, y) > 1e-9 else 0.0


def _turned(solid: Solid, degrees: float) -> Solid:
    return solid.rotate((0.0, 0.0, degrees))


def _housing(base: Array, radius: float, turn: float) -> list[Solid]:
    z = float(base[2])
    top = z - _SERVO_TOP
    hub = bevelled_rod((0, 0, 12), (0, 0, top + 6), 32, 0.5) - rod((0, 0, 14), (0, 0, 200), 25)
    plate = bevelled_rod((0, 0, _FLANGE_RING), (0, 0, _FLANGE_PLATE), 49.5, 0.6, 64)
    collar = merged([ring((0, 0, top - 7), (0, 0, top), 37, 25), *_arms(top)])
    lower = [_lower_bracket(z - _SERVO_BOTTOM), _disc(z, radius), _walls(z, radius)]
    bottom = bevelled_rod((0, 0, z - _PLATE_TOP), (0, 0, z - _PLATE_BOTTOM), radius, 0.8, 64)
    bottom -= rod((0, 0, z - _PLATE_TOP - 1), (0, 0, z - _PLATE_TOP + 3), 17)
    body = merged([hub, plate, collar, *lower, bottom])
    return [_turned(body, turn), _exit_block(base, turn)]


def _arms(top: float) -> list[Solid]:
    """Caps over the servos, with their screw bosses and the sloped ribs up to the hub."""
    solids = []
    outer = SERVO_INNER + SERVO[0]
    half = SERVO[1] / 2
    for azimuth in SERVO_AZIMUTHS_DEG:
        cap = block((26, -half - 0.8, top - 4), (outer + 0.8, half + 0.8, top + 2))
        notch = block((outer - 8, -4.5, top - 9), (outer + 3, 4.5, top + 5))
        bosses = [
            block((outer - 11, side - 4.6, top - 9), (outer - 1, side + 4.6, top + 1), 1.0)
            for side in (-half + 4.6, half - 4.6)
        ]
        neck = block((24, -half + 3, top - 7), (44, half - 3, top + 1))
        rib = prism([[29, -top + 21], [29, -top + 3], [outer - 12, -top + 3]], -1.6, 1.6)
        upright = rib.transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]])
        ribs = [upright.translate((0, y, 0)) for y in (-half + 5, half - 5)]
        solids.append(_turned(merged([cap, neck, *bosses, *ribs]) - notch, azimuth))
    return solids


def _lower_bracket(top: float) -> Solid:
    """Trays under the servos, ``top`` at the height of the servos' lower faces."""
    outer, half = SERVO_INNER + SERVO[0] + 0.8, SERVO[1] / 2 + 0.8
    trays = [
        _turned(block((10, -half, top - 1.5), (outer, half, top + 6.5)), azimuth)
        for azimuth in SERVO_AZIMUTHS_DEG
    ]
    return merged(trays) - rod((0, 0, top - 9), (0, 0, top + 9), 12)


def _disc(z: float, radius: float) -> Solid:
    disc = bevelled_rod((0, 0, z - _DISC_TOP), (0, 0, z - _DISC_BOTTOM), radius, 0.8, 64)
    passes = [
        _turned(rod((HORN_RADIUS, 0, z - 30), (HORN_RADIUS, 0, z), 11.5, 32), azimuth)
        for azimuth in SERVO_AZIMUTHS_DEG
    ]
    return disc - merged([*passes, rod((0, 0, z - 30), (0, 0, z), 12)])


def _walls(z: float, radius: float) -> Solid:
    """What carries the lower plate: arcs between the windows of the pulleys."""
    low, high = z - _DISC_BOTTOM - 1, z - _PLATE_TOP + 1
    wall = ring((0, 0, low), (0, 0, high), radius - 2, radius - 7, 64)
    windows = [
        _turned(block((10, -19, low - 1), (80, 19, high + 1)), azimuth)
        for azimuth in SERVO_AZIMUTHS_DEG
    ]
    front = block((10, -26, low - 1), (80, 26, high + 1))
    return wall - merged([*windows, front])


def _exit_block(base: Array, turn: float) -> Solid:
    """The sideways block through which the shaft leaves, at the configured shaft base."""
    z = float(base[2])
    reach = float(np.hypot(base[0], base[1]))
    solid = block((reach - 16, -8, z - 8.5), (reach + 1.5, 8, z - _PLATE_TOP + 2), 0.8)
    solid += block((reach - 30, -5, z - 5), (reach - 14, 5, z - _PLATE_TOP + 2))
    return _turned(solid, float(np.degrees(np.arctan2(base[1], base[0]))) if reach > 1 else turn)


def _servo(z: float) -> Solid:
    """One servo on the x axis: a box of two halves with a parting line and a cable notch."""
    half = SERVO[1] / 2
    inner, outer = SERVO_INNER, SERVO_INNER + SERVO[0]
    top, bottom = z - _SERVO_TOP, z - _SERVO_BOTTOM
    body = block((inner, -half, top), (outer, half, bottom - 6.2), 1.2)
    lid = block((inner, -half, bottom - 6.0), (outer, half, bottom), 1.2)
    waist = block((inner + 1, -half + 0.6, bottom - 8), (outer - 0.6, half - 0.6, bottom - 4))
    notch = block((outer - 4, -4.5, top - 1), (outer + 1, 4.5, top + 5.5))
    return merged([body, lid, waist]) - notch


def _servo_holes(z: float) -> list[Solid]:
    """Screw holes as dark discs on the outer and the side faces of the servo on the x axis."""
    half, outer = SERVO[1] / 2, SERVO_INNER + SERVO[0]
    low, high = z - _SERVO_TOP + 9.5, z - _SERVO_BOTTOM - 9.5
    places = [((outer, y), (1.0, 0.0)) for y in (-8.0, 8.0)]
    for side in (-1.0, 1.0):
        places += [((x, side * half), (0.0, side)) for x in (SERVO_INNER + 14, outer - 6)]
    holes = []
    for (x, y), outward in places:
        sunk, proud = -1.0 * np.array(outward), 0.12 * np.array(outward)
        holes += [
            rod((x + sunk[0], y + sunk[1], h), (x + proud[0], y + proud[1], h), 1.25, SMALL)
            for h in (low, high)
        ]
    return holes


def _pulley(z: float, radius: float) -> list[Solid]:
    """Grooved pulley at the height of the shaft: two flanges about a core of the pulley radius."""
    x = HORN_RADIUS
    levels = ((z - 5.0, z - 3.4, 11.0), (z - 3.4, z - 1.4, radius + 3), (z - 1.4, z + 0.2, 11.0))
    solids = [bevelled_rod((x, 0, a), (x, 0, b), r, 0.3, 32) for a, b, r in levels]
    return [*solids, rod((x, 0, z), (x, 0, z - _PLATE_TOP + 1), radius, 24)]


def _horn(z: float) -> list[Solid]:
    x = HORN_RADIUS
    horn = bevelled_rod((x, 0, z - _SERVO_BOTTOM - 1), (x, 0, z - 5.2), 9.5, 0.5, 32)
    screws = [
        rod((x + 8 * c, 8 * s, z - 8), (x + 8 * c, 8 * s, z - 5.0), 1.0, SMALL)
        for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    return [horn, *screws]


def _flange_ring() -> Solid:
    return bevelled_rod((0, 0, 0), (0, 0, _FLANGE_RING), 49.5, 0.8, 64)


def _flange_screws() -> list[Solid]:
    places = [(43 * np.cos(a), 43 * np.sin(a)) for a in np.radians([0, 60, 120, 180, 240, 300])]
    return [bevelled_rod((x, y, -1.2), (x, y, 2), 2.6, 0.4, 16) for x, y in places]


def _hub_holes(turn: float) -> list[Solid]:
    directions = [(np.cos(a), np.sin(a)) for a in np.radians([turn + 90 * k for k in range(4)])]
    return [rod((28 * c, 28 * s, 20), (32.1 * c, 32.1 * s, 20), 3.6, 24) for c, s in directions]


def _bushing(module: Module) -> list[Solid]:
    """Steel sleeve that holds the shaft in its block."""
    rotation, origin = shaft_rotation(module), 1e3 * np.array(module.shaft_base_m)
    steps = ((-3.0, 2.6, 4.4), (2.6, 6.0, 3.6))
    solids = [bevelled_rod((0, 0, a), (0, 0, b), r, 0.3, 24) for a, b, r in steps]
    return [moved(solid, rotation, origin) for solid in solids]
