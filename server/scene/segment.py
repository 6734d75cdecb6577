"""The continuum segment: twelve disks, the backbone and four coloured tendons.

Its shape is that of constant curvature, pulled aside smoothly to where the tip is: something that
presses on the tip bends the segment by more than a circle.

Two batched meshes carry all of it, so a bend costs four messages.
"""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from robot.configuration import Instrument
from robot.rotations import exponential, multiply, quaternion_from_matrix
from robot.segment import shape_frames
from server.scene.palette import BACKBONE, DISK, TENDONS
from server.scene.shapes import quaternions_from_z, quaternions_of, revolve, round_bar

ROOT = "/instrument"
BEND_RESOLUTION = 1e-4
"""Changes of (u, v) smaller than this (rad) are not sent: 3 micrometres at the tip."""
POSITION_RESOLUTION = 5e-6
ASIDE_RESOLUTION = 2e-5
DISK_SHARE = 0.36
"""Thickness of a disk as a share of the distance between two."""
TENDON_WIDTH = 2.4
"""The tendons are drawn this many times thicker than they are, to be seen at arm's length."""
OVERLAP = 1.16
"""Pieces of tendon are drawn longer than the distance between two disks, so that they meet inside
the disks at every bend without being resized."""


class SceneSegment:
    """Nodes below ``/instrument``, whose frame is the segment's base (end of the rigid shaft)."""

    def __init__(self, server: viser.ViserServer, instrument: Instrument) -> None:
        """Build the nodes for a straight segment.

        Args:
            server: draws.
            instrument: dimensions.
        """
        self._length = instrument.segment_length_m
        self._count = instrument.disk_count
        self._fractions = np.arange(self._count + 1) / self._count
        turns = np.arange(len(TENDONS)) * (2.0 * np.pi / len(TENDONS))
        self._holes = instrument.tendon_pitch_radius_m * np.stack(
            [np.cos(turns), np.sin(turns), np.zeros_like(turns)], axis=1
        )
        self._root = server.scene.add_frame(ROOT, show_axes=False)
        pitch = self._length / self._count
        positions, rotations = shape_frames(0.0, 0.0, self._length, self._fractions)
        thickness = DISK_SHARE * pitch
        disk = round_bar(-thickness, 0.0, instrument.disk_diameter_m / 2, 0.12 * thickness, 32)
        self._disks = server.scene.add_batched_meshes_simple(
            f"{ROOT}/disks",
            disk.vertices,
            disk.faces,
            quaternions_of(rotations[1:]),
            positions[1:],
            batched_colors=DISK,
            lod="off",
        )
        bar = revolve([(1.0, -0.5), (1.0, 0.5), (0.0, 0.5)], 10)
        places, directions = self._pieces(positions, rotations)
        self._lines = server.scene.add_batched_meshes_simple(
            f"{ROOT}/tendons",
            bar.vertices,
            bar.faces,
            quaternions_from_z(directions),
            places,
            batched_scales=self._scales(instrument, pitch),
            batched_colors=self._colours(),
            lod="off",
        )
        self._drawn, self._drawn_aside = np.zeros(2), np.zeros(3)
        self._drawn_position = np.full(3, np.nan)
        self._drawn_wxyz = np.full(4, np.nan)

    def _scales(self, instrument: Instrument, pitch: float) -> NDArray[np.float64]:
        tendon = TENDON_WIDTH * instrument.tendon_diameter_m / 2
        radii = [0.13 * instrument.disk_diameter_m] + [tendon] * len(TENDONS)
        one = np.array([[radius, radius, OVERLAP * pitch] for radius in radii])
        return np.repeat(one, self._count, axis=0)

    def _colours(self) -> NDArray[np.uint8]:
        return np.repeat(np.array([BACKBONE, *TENDONS], dtype=np.uint8), self._count, axis=0)

    def _pieces(
        self, positions: NDArray[np.float64], rotations: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Middles and unit directions of backbone and tendon pieces, (5 n, 3) each."""
        through = np.concatenate([np.zeros((1, 3)), self._holes])
        knots = positions[None] + np.einsum("nij,kj->kni", rotations, through)
        steps = knots[:, 1:] - knots[:, :-1]
        middles = 0.5 * (knots[:, 1:] + knots[:, :-1])
        directions = steps / np.linalg.norm(steps, axis=2, keepdims=True)
        return middles.reshape(-1, 3), directions.reshape(-1, 3)

    def _pull_aside(
        self,
        positions: NDArray[np.float64],
        rotations: NDArray[np.float64],
        aside: NDArray[np.float64],
    ) -> None:
        """Move the tip by ``aside`` (3,) and all before it along with it, in place.

        The segment's direction changes neither at its base nor at its tip.
        """
        s = self._fractions[:, None]
        positions += s**2 * (3.0 - 2.0 * s) * aside
        before = rotations[:, :, 2].copy()
        after = before + 6.0 * s * (1.0 - s) * aside / self._length
        after /= np.linalg.norm(after, axis=1, keepdims=True)
        turn, old = np.empty((3, 3)), np.empty((3, 3))
        for index, vector in enumerate(np.cross(before, after)):
            # The sine of the angle is near enough to the angle.
            exponential(vector, turn)
            old[:] = rotations[index]
            multiply(turn, old, rotations[index])

    def update(
        self,
        position: NDArray[np.float64],
        rotation: NDArray[np.float64],
        bend: NDArray[np.float64],
        tip: NDArray[np.float64],
    ) -> None:
        """Draw the segment, sending only what changed.

        Args:
            position: (3,) segment base in the world, m.
            rotation: (3, 3) of the segment base frame in the world.
            bend: (2,) u and v, rad.
            tip: (3,) in the world, m.
        """
        if not np.allclose(position, self._drawn_position, rtol=0.0, atol=POSITION_RESOLUTION):
            self._drawn_position[:] = position
            self._root.position = position
        wxyz = np.empty(4)
        quaternion_from_matrix(rotation, wxyz)
        if not np.allclose(wxyz, self._drawn_wxyz, rtol=0.0, atol=POSITION_RESOLUTION):
            self._drawn_wxyz[:] = wxyz
            self._root.wxyz = wxyz
        positions, rotations = shape_frames(
            float(bend[0]), float(bend[1]), self._length, self._fractions
        )
        aside = rotation.T @ (tip - position) - positions[-1]
        bent = np.abs(bend - self._drawn).max() >= BEND_RESOLUTION
        if not bent and np.abs(aside - self._drawn_aside).max() < ASIDE_RESOLUTION:
            return
        self._drawn[:], self._drawn_aside[:] = bend, aside
        self._pull_aside(positions, rotations, aside)
        places, directions = self._pieces(positions, rotations)
        self._disks.batched_positions = positions[1:].astype(np.float32)
        self._disks.batched_wxyzs = quaternions_of(rotations[1:])
        self._lines.batched_positions = places.astype(np.float32)
        self._lines.batched_wxyzs = quaternions_from_z(directions).astype(np.float32)
