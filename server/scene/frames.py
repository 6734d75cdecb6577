"""Axes of the frames people talk about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

from server.scene.palette import TRUE

ROOT = "/frames"
LABEL_SCALE = 0.7


LabelAnchor = Literal["bottom-center", "center-left", "center-right"]


class Axes(NamedTuple):
    """Axes to be drawn at a scene node: length and radius in m; a label above or beside, or ""."""

    node: str
    length: float
    radius: float
    label: str = ""
    anchor: LabelAnchor = "bottom-center"


class SceneFrames:
    """Axes: x red, y green, z blue; hidden until asked for.

    Attributes:
        words: which frames they are, for people.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        words: str,
        tips: Sequence[Axes],
        standing: Sequence[Axes],
    ) -> None:
        """Build the axes.

        Args:
            server: draws.
            words: which frames they are, for people.
            tips: of the true tips, which :meth:`update` moves.
            standing: of other nodes, which carry them along.
        """
        self._tips = [
            server.scene.add_frame(
                axes.node,
                axes_length=axes.length,
                axes_radius=axes.radius,
                origin_radius=2.25 * axes.radius,
                origin_color=TRUE,
            )
            for axes in tips
        ]
        self._nodes: list[viser.SceneNodeHandle] = [
            *self._tips,
            *(
                server.scene.add_frame(axes.node, axes_length=axes.length, axes_radius=axes.radius)
                for axes in standing
            ),
        ]
        for axes in (*tips, *standing):
            if axes.label:
                server.scene.add_label(
                    f"{axes.node}/label",
                    axes.label,
                    position=(0.0, 0.0, 1.1 * axes.length),
                    font_screen_scale=LABEL_SCALE,
                    anchor=axes.anchor,
                )
        self.words = words
        self.visible = False

    @property
    def visible(self) -> bool:
        """Whether the axes are shown."""
        return bool(self._tips[0].visible)

    @visible.setter
    def visible(self, visible: bool) -> None:
        for node in self._nodes:
            node.visible = visible

    def update(self, *poses: tuple[NDArray[np.float64], NDArray[np.float64]]) -> None:
        """Move the tips' axes, each to (3,) m and (4,) in the world; free while hidden."""
        if not self.visible:
            return
        for tip, (position, wxyz) in zip(self._tips, poses, strict=True):
            tip.position = position
            tip.wxyz = wxyz
