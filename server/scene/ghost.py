"""The clamped target: where a tip is asked to be, shown when it is not there yet."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from server.scene.palette import DESIRED
from server.scene.shapes import Mesh

ROOT = "/ghost"
PERIOD = 1.0 / 15.0
SHOWN_FROM, HIDDEN_BELOW = 3e-4, 1.5e-4
"""Distance (m) at which the ghost appears and disappears; two, so that it does not flicker."""
RADIANS_AS_METRES = 0.02


class SceneGhost:
    """A translucent tip at the desired pose."""

    def __init__(self, server: viser.ViserServer, root: str, tip: Mesh, axes: float = 0.0) -> None:
        """Build the ghost, hidden.

        Args:
            server: draws.
            root: scene node of the ghost.
            tip: its shape, in the frame of the tip.
            axes: length of the axes at it, m; none where only its position counts.
        """
        self._root = server.scene.add_frame(
            root,
            show_axes=axes > 0.0,
            axes_length=axes,
            axes_radius=0.025 * axes,
            origin_radius=0.0625 * axes,
            origin_color=DESIRED,
            visible=False,
        )
        server.scene.add_mesh_simple(
            f"{root}/tip",
            tip.vertices,
            tip.faces,
            color=DESIRED,
            opacity=0.55,
            cast_shadow=False,
            receive_shadow=False,
        )
        self._drawn = 0.0

    def update(
        self,
        now: float,
        position: NDArray[np.float64],
        wxyz: NDArray[np.float64],
        from_tip: tuple[float, float],
    ) -> None:
        """Show or hide the ghost.

        Args:
            now: s.
            position: (3,) desired tip, m.
            wxyz: (4,) desired tip.
            from_tip: how far the desired tip is from the drawn one, m and rad.
        """
        if now - self._drawn < PERIOD:
            return
        self._drawn = now
        away = from_tip[0] + RADIANS_AS_METRES * from_tip[1]
        shown = away > (HIDDEN_BELOW if self._root.visible else SHOWN_FROM)
        if shown:
            self._root.position = position
            self._root.wxyz = wxyz
        if shown != self._root.visible:
            self._root.visible = shown
