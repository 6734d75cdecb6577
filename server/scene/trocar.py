"""The trocar: a port that turns with the shaft, the translucent body wall, the RCM marker."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from robot.configuration import Configuration
from server.scene.palette import PORT, RCM, WALL
from server.scene.shapes import Mesh, quaternions_from_z, revolve, ring

ROOT = "/trocar"
WALL_OPACITY = 0.45
HOLE_RADIUS = 0.0085
"""Of the wall's opening, m: the port may lean by more than a half right angle in it."""
RESOLUTION = 2e-5


class SceneTrocar:
    """Nodes below ``/trocar``, whose frame stands at the RCM with the axes of the world."""

    def __init__(self, server: viser.ViserServer, configuration: Configuration) -> None:
        """Build the nodes where the configuration puts the trocar.

        Args:
            server: draws.
            configuration: sections ``trocar``, ``instrument`` and ``start``.
        """
        scene, trocar = server.scene, configuration.trocar
        shaft = configuration.instrument.shaft_diameter_m / 2
        normal = _unit(np.array(trocar.wall_normal))
        self._root = scene.add_frame(ROOT, show_axes=False, position=trocar.position_m)
        upright = quaternions_from_z(normal[None])[0]
        half = trocar.wall_thickness_m / 2
        skin = ring(HOLE_RADIUS, trocar.wall_radius_m, -half, half, 96)
        self.wall = scene.add_mesh_simple(
            f"{ROOT}/wall",
            skin.vertices,
            skin.faces,
            color=WALL,
            opacity=WALL_OPACITY,
            wxyz=upright,
            cast_shadow=False,
            receive_shadow=False,
        )
        rim = _rim(HOLE_RADIUS, half)
        scene.add_mesh_simple(f"{ROOT}/rim", rim.vertices, rim.faces, color=PORT, wxyz=upright)
        port = _port(shaft)
        self._port = scene.add_mesh_simple(f"{ROOT}/port", port.vertices, port.faces, color=PORT)
        arm = 0.022
        marks = np.array([[axis * arm, -axis * arm] for axis in np.eye(3)])
        scene.add_line_segments(f"{ROOT}/rcm", marks, RCM, thickness=1.5, thickness_units="screen")
        self.label = scene.add_label(
            f"{ROOT}/label",
            "RCM",
            position=(0.0, 0.0, arm),
            font_screen_scale=0.7,
            anchor="bottom-center",
        )
        self._position = np.array(trocar.position_m, dtype=np.float64)
        self._direction = np.zeros(3)
        self.update(self._position, -_unit(np.array(configuration.start.shaft_direction)))

    def fade(self, opacity: float) -> None:
        """Set the wall's opacity, 0 to 1."""
        self.wall.visible = opacity > 0.0
        self.wall.opacity = opacity

    def update(self, position: NDArray[np.float64], outward: NDArray[np.float64]) -> None:
        """Follow the trocar and lean the port along the shaft.

        Args:
            position: (3,) RCM in the world, m.
            outward: (3,) unit direction of the shaft, out of the body.
        """
        if np.abs(position - self._position).max() > RESOLUTION / 4:
            self._position[:] = position
            self._root.position = position
        if np.abs(outward - self._direction).max() > RESOLUTION:
            self._direction[:] = outward
            self._port.wxyz = quaternions_from_z(outward[None])[0]


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    length: NDArray[np.float64] = vector / np.linalg.norm(vector)
    return length


def _rim(hole: float, half: float) -> Mesh:
    return ring(hole - 0.0012, hole + 0.0045, -half - 0.0016, half + 0.0016, 64)


def _port(shaft: float) -> Mesh:
    """A cannula with a funnel head; the shaft passes with a gap."""
    bore, tube = shaft + 0.0009, shaft + 0.0022
    corners = [
        (bore, -0.020),
        (tube, -0.018),
        (tube, 0.010),
        (0.0078, 0.0125),
        (0.0078, 0.0185),
        (0.0066, 0.0200),
        (0.0052, 0.0200),
        (bore, 0.0150),
        (bore, -0.020),
    ]
    return revolve(corners, 48)
