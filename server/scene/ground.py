"""What the robot stands on or before, and the light."""

from __future__ import annotations

import viser

from server.scene.palette import GRID_CELL, GRID_SECTION


class SceneGround:
    """``/ground``: a grid for scale, and the light."""

    def __init__(
        self,
        server: viser.ViserServer,
        centre: tuple[float, float, float],
        cell: float,
        across: float,
    ) -> None:
        """Build the grid and set the light; z is up.

        Args:
            server: draws.
            centre: of the grid, m.
            cell: of the grid; every fifth line is stronger, m.
            across: width of the grid, m.
        """
        self._scene = server.scene
        self._scene.set_up_direction("+z")
        self.shadows(False)
        self._scene.add_grid(
            "/ground/grid",
            width=across,
            height=across,
            plane="xy",
            cell_size=cell,
            section_size=5.0 * cell,
            cell_color=GRID_CELL,
            section_color=GRID_SECTION,
            cell_thickness=0.5,
            section_thickness=0.8,
            fade_distance=4.0 / 3.0 * across,
            fade_strength=1.5,
            shadow_opacity=0.15,
            position=centre,
        )

    def shadows(self, shown: bool) -> None:
        """Cast shadows or not; they double the cost of a picture on a machine without a GPU."""
        self._scene.configure_default_lights(cast_shadow=shown)
