"""Axes of the frames people talk about, hidden until asked for."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from server.scene.palette import TRUE

ROOT = "/frames"
LABEL_SCALE = 0.7


class SceneFrames:
    """``/frames``: base, trocar, flange and true tip; x red, y green, z blue."""

    def __init__(self, server: viser.ViserServer, flange: str, trocar: str) -> None:
        """Build the axes.

        Args:
            server: draws.
            flange: scene node of the flange.
            trocar: scene node of the trocar.
        """
        scene = server.scene
        self._tip = scene.add_frame(
            f"{ROOT}/tip",
            axes_length=0.014,
            axes_radius=0.0004,
            origin_radius=0.0009,
            origin_color=TRUE,
        )
        base = scene.add_frame(f"{ROOT}/base", axes_length=0.12, axes_radius=0.002)
        on_flange = scene.add_frame(f"{flange}/axes", axes_length=0.09, axes_radius=0.0015)
        on_trocar = scene.add_frame(f"{trocar}/axes", axes_length=0.03, axes_radius=0.0005)
        self._nodes: list[viser.SceneNodeHandle] = [self._tip, base, on_flange, on_trocar]
        for node, name, high in (
            (self._tip, "tip", 0.016),
            (base, "base", 0.13),
            (on_flange, "flange", 0.1),
        ):
            scene.add_label(
                f"{node.name}/label",
                name,
                position=(0.0, 0.0, high),
                font_screen_scale=LABEL_SCALE,
                anchor="bottom-center",
            )
        self.visible = False

    @property
    def visible(self) -> bool:
        """Whether the axes are shown."""
        return bool(self._tip.visible)

    @visible.setter
    def visible(self, visible: bool) -> None:
        for node in self._nodes:
            node.visible = visible

    def update(self, position: NDArray[np.float64], wxyz: NDArray[np.float64]) -> None:
        """Move the tip's axes: (3,) m and (4,) in the world; costs nothing while hidden."""
        if self.visible:
            self._tip.position = position
            self._tip.wxyz = wxyz
