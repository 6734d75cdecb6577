"""The vector from A's tip to B's: whole where B is in its place beside A, broken elsewhere."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from server.scene.ghost import SceneGhost
from server.scene.palette import TRUE, WARNING
from server.scene.shapes import ball

ROOT = "/relative"
IN_PLACE = 0.25
"""Share of the largest relative error up to which B counts as in its place."""
DASHES = 9
HEAD = 0.003
RESOLUTION = 2e-5
GHOST_RADIUS = 0.0022


class SceneRelative:
    """``/relative``: line, words and a ghost of B's place."""

    def __init__(self, server: viser.ViserServer, limit: float) -> None:
        """Build the nodes.

        Args:
            server: draws.
            limit: largest relative error, m; more pauses the motion.
        """
        self._limit = limit
        server.scene.add_frame(ROOT, show_axes=False)
        self.line = server.scene.add_line_segments(
            f"{ROOT}/vector",
            np.zeros((1, 2, 3)),
            TRUE,
            thickness=3.5,
            thickness_units="screen",
        )
        self.label = server.scene.add_label(
            f"{ROOT}/label", "", font_screen_scale=0.8, anchor="top-center", visible=False
        )
        self._ghost = SceneGhost(server, "/ghost b", ball(GHOST_RADIUS))
        self._drawn = np.full(6, np.nan)
        self._in_place: bool | None = None

    def update(
        self,
        now: float,
        tip_a: NDArray[np.float64],
        tip_b: NDArray[np.float64],
        place_b: NDArray[np.float64],
    ) -> None:
        """Draw the vector between the true tips.

        Args:
            now: s.
            tip_a: (3,) m.
            tip_b: (3,) m.
            place_b: (3,) where B's tip shall be, m.
        """
        error = float(np.linalg.norm(place_b - tip_b))
        self._ghost.update(now, place_b, np.array([1.0, 0.0, 0.0, 0.0]), (error, 0.0))
        in_place = error <= IN_PLACE * self._limit
        ends = np.concatenate([tip_a, tip_b])
        if in_place == self._in_place and np.abs(ends - self._drawn).max() < RESOLUTION:
            return
        self._drawn[:] = ends
        self.line.points = _arrow(tip_a, tip_b, dashed=not in_place)
        if not in_place:
            words = f"B is {error * 1e3:.1f} mm from its place"
            if self.label.text != words:
                self.label.text = words
            self.label.position = tip_b
        if in_place != self._in_place:
            self._in_place = in_place
            self.line.colors = np.array(TRUE if in_place else WARNING, dtype=np.uint8)
            self.label.visible = not in_place


def _arrow(
    start: NDArray[np.float64], end: NDArray[np.float64], *, dashed: bool
) -> NDArray[np.float32]:
    """Line pieces (n, 2, 3) of an arrow."""
    shares = np.linspace(0.0, 1.0, 2 * DASHES if dashed else 2).reshape(-1, 2)
    shaft = start + shares[:, :, None] * (end - start)
    length = float(np.linalg.norm(end - start))
    if length < 1e-6:
        return shaft.astype(np.float32)
    along = (end - start) / length
    across = np.cross(along, [0.0, 1.0, 0.0] if abs(along[1]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    back = end - min(HEAD, 0.4 * length) * along
    half = 0.4 * min(HEAD, 0.4 * length)
    head = np.array([[end, back + half * across], [end, back - half * across]])
    return np.concatenate([shaft, head]).astype(np.float32)
