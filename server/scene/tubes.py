"""Both concentric-tube arms: one batched mesh for all tubes, one thin line for what is commanded.

A tube that is inside another is not seen, so each is drawn where it is the outermost: behind the
channels from its rear end to that of the tube around it, in front of them from that tube's tip to
its own.
"""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from robot.concentric.backbone import backbone, tube_extents
from robot.concentric.design import Concentric
from robot.concentric.pair import ArmPair
from server.scene.palette import COMMANDED, TUBES
from server.scene.shapes import quaternions_from_z, revolve

ROOT = "/arms"
PIECES = 16
"""Straight pieces of the visible front part of one tube."""
LINE_PIECES = 48
WIDTH = 2.0
"""Tubes are drawn this many times thicker than they are, to be seen beside their length."""
OVERLAP = 1.03
"""Pieces are longer than their distance by this, so that no gap opens where the arm bends."""
COLLAR_LENGTH, COLLAR_WIDTH = 0.0009, 3.2
"""Of the mark at the rear end of each tube, where it is driven: m, and times the tube's radius."""
TRANSLATION_RESOLUTION, ROTATION_RESOLUTION = 5e-6, 5e-5
"""Changes smaller than this (m, rad) are not sent: a hundredth of a tube's radius at the tip."""
LINE_PERIOD = 0.1
APART = 1e-4
"""Translations (m) or rotations (100 times that, rad) that differ by more show the line."""


class SceneTubes:
    """Nodes below ``/arms``, in the frame of the endoscope's face."""

    def __init__(self, server: viser.ViserServer, design: Concentric, q: NDArray[np.float64]):
        """Build the nodes.

        Args:
            server: draws.
            design: of the tubes.
            q: (4n,) where the arms stand at first.
        """
        self._pair = ArmPair(design)
        self._radii = np.array([0.5e-3 * tube.outer_diameter_mm for tube in design.tubes])
        count = self._pair.count
        self._width = WIDTH
        self._drawn = np.full(4 * count, np.nan)
        self._drawn_line = -np.inf
        self._resolution = np.tile(
            np.repeat([TRANSLATION_RESOLUTION, ROTATION_RESOLUTION], count), 2
        )
        self._apart = np.tile(np.repeat([APART, 100.0 * APART], count), 2)
        bar = revolve([(0.0, -0.5), (1.0, -0.5), (1.0, 0.5), (0.0, 0.5)], 16)
        middles, directions, lengths = self._pieces(q, np.zeros(2 * count))
        server.scene.add_frame(ROOT, show_axes=False)
        self.mesh = server.scene.add_batched_meshes_simple(
            f"{ROOT}/tubes",
            bar.vertices,
            bar.faces,
            quaternions_from_z(directions),
            middles,
            batched_scales=self._scales(lengths),
            batched_colors=self._colours(),
            lod="off",
        )
        self.line = server.scene.add_line_segments(
            f"{ROOT}/commanded",
            np.zeros((1, 2, 3)),
            COMMANDED,
            thickness=1.5,
            thickness_units="screen",
            visible=False,
        )

    @property
    def width(self) -> float:
        """How many times thicker than they are the tubes are drawn."""
        return self._width

    @width.setter
    def width(self, width: float) -> None:
        self._width = width
        self._drawn[:] = np.nan

    def update(self, q: NDArray[np.float64], torsion: NDArray[np.float64]) -> None:
        """Draw the tubes where they have moved.

        Args:
            q: (4n,) translations and rotations of A's and B's tubes.
            torsion: (2n,) torsion rates at the channels' exits, rad/m.
        """
        if (np.abs(q - self._drawn) < self._resolution).all():
            return
        self._drawn[:] = q
        middles, directions, lengths = self._pieces(q, torsion)
        self.mesh.batched_positions = middles.astype(np.float32)
        self.mesh.batched_wxyzs = quaternions_from_z(directions).astype(np.float32)
        self.mesh.batched_scales = self._scales(lengths)

    def update_commanded(
        self,
        now: float,
        q: NDArray[np.float64],
        torsion: NDArray[np.float64],
        true_q: NDArray[np.float64],
    ) -> None:
        """Draw the commanded backbones where they are not the true ones; arguments as above."""
        if now - self._drawn_line < LINE_PERIOD:
            return
        self._drawn_line = now
        differs = bool((np.abs(q - true_q) > self._apart).any())
        if differs:
            count = self._pair.count
            ends = []
            for arm in range(2):
                own = q[2 * count * arm : 2 * count * (arm + 1)]
                reach = tube_extents(own, self._pair.tubes)[0, 2]
                knots = self._along(arm, q, torsion, np.linspace(0.0, reach, LINE_PIECES + 1))
                ends.append(np.stack([knots[:-1], knots[1:]], axis=1))
            self.line.points = np.concatenate(ends).astype(np.float32)
        if differs != self.line.visible:
            self.line.visible = differs

    def _along(
        self,
        arm: int,
        q: NDArray[np.float64],
        torsion: NDArray[np.float64],
        arc: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Points (m, 3) of an arm's backbone at arc lengths (m,), ascending, m."""
        count = self._pair.count
        positions, rotations = np.empty((len(arc), 3)), np.empty((len(arc), 3, 3))
        backbone(
            np.ascontiguousarray(q[2 * count * arm : 2 * count * (arm + 1)]),
            np.ascontiguousarray(torsion[count * arm : count * (arm + 1)]),
            self._pair.tubes,
            arc,
            positions,
            rotations,
        )
        moved: NDArray[np.float64] = positions + self._pair.channels[arm]
        return moved

    def _pieces(
        self, q: NDArray[np.float64], torsion: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Middles (k, 3), unit directions (k, 3) and lengths (k,) of all pieces of both arms.

        Of each arm first the tubes' fronts, the outermost first, then their rear parts, then the
        collars, the innermost first.
        """
        count = self._pair.count
        starts, ends = [], []
        for arm in range(2):
            own = q[2 * count * arm : 2 * count * (arm + 1)]
            extents = tube_extents(np.ascontiguousarray(own), self._pair.tubes)
            tips = np.concatenate([[0.0], extents[::-1, 2]])
            shares = np.arange(PIECES + 1) / PIECES
            arcs = tips[:-1, None] + shares * np.diff(tips)[:, None]
            knots = self._along(arm, q, torsion, arcs.ravel()).reshape(count, PIECES + 1, 3)
            starts.append(knots[:, :-1].reshape(-1, 3))
            ends.append(knots[:, 1:].reshape(-1, 3))
            rear = extents[:, 0]
            starts += [self._behind(arm, rear), self._behind(arm, rear)]
            around = np.append(rear[1:], 0.0)
            ends += [self._behind(arm, around), self._behind(arm, rear + COLLAR_LENGTH)]
        start, end = np.concatenate(starts), np.concatenate(ends)
        steps = end - start
        lengths = np.linalg.norm(steps, axis=1)
        directions = np.tile([0.0, 0.0, 1.0], (len(steps), 1))
        seen = lengths > 1e-9
        directions[seen] = steps[seen] / lengths[seen, None]
        return 0.5 * (start + end), directions, lengths

    def _behind(self, arm: int, arc: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) of the straight channel of an arm at arc lengths (n,) not above 0."""
        points = np.tile(self._pair.channels[arm], (len(arc), 1))
        points[:, 2] += arc
        return points

    def _tube_of_piece(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Which tube each piece belongs to, and whether it is a collar."""
        count = self._pair.count
        tubes = np.arange(count)
        arm = np.concatenate([np.repeat(tubes[::-1], PIECES), tubes, tubes])
        collar = np.arange(len(arm)) >= len(arm) - count
        return np.tile(arm, 2), np.tile(collar, 2)

    def _scales(self, lengths: NDArray[np.float64]) -> NDArray[np.float32]:
        tube, collar = self._tube_of_piece()
        radii = self._width * self._radii[tube]
        radii[collar] = COLLAR_WIDTH * self._radii.max()
        stretched = np.where(collar, lengths, OVERLAP * lengths)
        return np.stack([radii, radii, np.maximum(stretched, 1e-7)], axis=1).astype(np.float32)

    def _colours(self) -> NDArray[np.uint8]:
        colours = np.array(TUBES, dtype=np.uint8)
        return np.asarray(colours[self._tube_of_piece()[0]])
