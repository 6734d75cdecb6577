"""What the robot stands on, and the light."""

from __future__ import annotations

import viser

from server.scene.palette import GRID_CELL, GRID_SECTION, PLINTH
from server.scene.shapes import round_bar

FLOOR = -0.16
"""Height of the floor (m): below everything the tip reaches through the default trocar."""
PLINTH_RADIUS = 0.08


class SceneGround:
    """``/ground``: a grid for scale (cells of 5 cm), and the plinth below the arm's base."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Build the nodes and set the light."""
        self._scene = server.scene
        self._scene.set_up_direction("+z")
        self.shadows(False)
        self._scene.add_grid(
            "/ground/grid",
            width=3.0,
            height=3.0,
            plane="xy",
            cell_size=0.05,
            section_size=0.25,
            cell_color=GRID_CELL,
            section_color=GRID_SECTION,
            cell_thickness=0.5,
            section_thickness=0.8,
            fade_distance=4.0,
            fade_strength=1.5,
            shadow_opacity=0.15,
            position=(0.2, 0.0, FLOOR),
        )
        # A hair below the arm's base, so that the two surfaces do not fight for the same pixels.
        plinth = round_bar(FLOOR + 0.0005, -0.0005, PLINTH_RADIUS, 0.004, 64)
        self._scene.add_mesh_simple("/ground/plinth", plinth.vertices, plinth.faces, color=PLINTH)

    def shadows(self, shown: bool) -> None:
        """Cast shadows or not; they double the cost of a picture on a machine without a GPU."""
        self._scene.configure_default_lights(cast_shadow=shown)
