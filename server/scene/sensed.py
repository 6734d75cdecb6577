"""What is sensed: the estimated shape as hoops around the segment, the force as an arrow.

The arrow shows the force along the directions in which it is observable, with an ellipsoid of its
uncertainty at its end; along any other there is a broken grey line through that end instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.rotations import matrix_from_quaternion, quaternion_from_matrix
from robot.sensing.curvature_modes import shape_of_modes
from robot.sensing.faults import SensingFault
from robot.sensing.records import CURVATURE_MODES
from server.scene.palette import ESTIMATED, FAINT, UNKNOWN
from server.scene.shapes import ball, quaternions_of, ring
from server.sensed_force import KnownAxes, fault_of, force_axes

ROOT = "/sensed"
PERIOD = 0.1
"""Between two pictures, s: the estimate follows a tracker and is never still."""
METRES_PER_NEWTON = 0.05
SHORTEST = 0.006
"""A shorter arrow is a small copy of this one, m."""
LONGEST = 0.1
"""No arrow is drawn longer than this, m; its label goes on telling the force."""
DEVIATIONS = 2.0
"""Half axes of the ellipsoid, in standard deviations."""
STANDS_OUT, IS_FAINT = 3.0, 2.0
"""Standard deviations from which on a force stands out, and below which it is faint; two, so that
the arrow does not flicker."""
HOOPS = 6
REACH = 0.012
"""Half length of the line along a direction in which the force is not observable, m."""
DASHES = 6
RESOLUTION = 5e-5
"""Places that changed by less than this (m) are not sent."""
SAME_SIZE, SAME_DIRECTION = 0.1, 0.998
"""An uncertainty whose axes changed by less than this share, and turned by less than the angle of
this cosine, is not sent."""


class SceneSensed:
    """``/sensed``: hoops, arrow, ellipsoid, broken lines and label; hidden without an estimate."""

    def __init__(self, server: viser.ViserServer, configuration: Configuration) -> None:
        """Build the nodes, hidden.

        Args:
            server: draws.
            configuration: dimensions of the segment, and the forces to expect.
        """
        instrument = configuration.instrument
        self._length = instrument.segment_length_m
        self._expected = configuration.sensing.force_expected_n
        self._fractions = np.arange(1, HOOPS + 1) / HOOPS
        self._known = KnownAxes()
        self._drawn_at, self._stands_out = -np.inf, True
        self._ends = np.full((2, 3), np.inf)
        self._half, self._directions, self._count = np.ones(3), np.eye(3), -1
        self._root = server.scene.add_frame(ROOT, show_axes=False, visible=False)
        radius = instrument.disk_diameter_m / 2
        hoop = ring(1.2 * radius, 1.45 * radius, -0.1 * radius, 0.1 * radius, 40)
        positions, rotations = shape_of_modes(
            np.zeros(CURVATURE_MODES), self._length, self._fractions
        )
        self.hoops = server.scene.add_batched_meshes_simple(
            f"{ROOT}/shape",
            hoop.vertices,
            hoop.faces,
            quaternions_of(rotations),
            positions.astype(np.float32),
            batched_colors=ESTIMATED,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self.arrow = server.scene.add_arrows(
            f"{ROOT}/force",
            np.zeros((1, 2, 3)),
            ESTIMATED,
            shaft_radius=0.3 * radius,
            head_radius=0.75 * radius,
            head_length=1.6 * radius,
        )
        self._end = server.scene.add_frame(f"{ROOT}/end", show_axes=False)
        sphere = ball(1.0, 32)
        self.ellipsoid = server.scene.add_mesh_simple(
            f"{ROOT}/end/uncertainty",
            sphere.vertices,
            sphere.faces,
            color=ESTIMATED,
            opacity=0.3,
            cast_shadow=False,
            receive_shadow=False,
        )
        self.unknown = server.scene.add_line_segments(
            f"{ROOT}/end/unknown",
            np.zeros((1, 2, 3)),
            UNKNOWN,
            thickness=3.5,
            thickness_units="screen",
        )
        self.label = server.scene.add_label(
            f"{ROOT}/end/label", "", font_screen_scale=0.8, anchor="bottom-left"
        )

    def update(self, now: float, report: Any) -> None:
        """Draw the estimate of the instrument's ``report`` (s), at most ten times a second."""
        if now - self._drawn_at < PERIOD:
            return
        self._drawn_at = now
        shown = fault_of(report) == SensingFault.NONE
        shown = shown and abs(float(np.linalg.norm(report["estimate_wxyz"])) - 1.0) < 1e-3
        if shown:
            self._draw_shape(report)
            self._draw_force(now, report)
        if shown != self._root.visible:
            self._root.visible = shown

    def _draw_shape(self, report: Any) -> None:
        """The shape is told from the shaft's end on, and ends at the estimated tip."""
        places, turns = shape_of_modes(report["estimate_modes"], self._length, self._fractions)
        tip = np.empty((3, 3))
        matrix_from_quaternion(report["estimate_wxyz"], tip)
        base = tip @ turns[-1].T
        places = report["estimate_position"] + (places - places[-1]) @ base.T
        if np.abs(places - self.hoops.batched_positions).max() < RESOLUTION:
            return
        self.hoops.batched_positions = places.astype(np.float32)
        self.hoops.batched_wxyzs = quaternions_of(base @ turns)

    def _draw_force(self, now: float, report: Any) -> None:
        axes = force_axes(
            report["estimate_force"], report["estimate_force_covariance"], self._expected
        )
        count = self._known.count(now, axes)
        force, deviation = axes.known(count)
        vector = METRES_PER_NEWTON * axes.components[:count] @ axes.directions[:count]
        length = float(np.linalg.norm(vector))
        if length > LONGEST:
            vector *= LONGEST / length
        tip = report["estimate_position"]
        end = tip + vector
        if np.abs(np.array([tip, end]) - self._ends).max() >= RESOLUTION:
            self._ends[:] = tip, end
            self._end.position = end
            self._draw_arrow(tip, vector)
        half = np.maximum(DEVIATIONS * METRES_PER_NEWTON * axes.deviations, 1e-6)
        half[count:] = half[0]
        self._draw_uncertainty(half, axes.directions, count)
        stands_out = force > (IS_FAINT if self._stands_out else STANDS_OUT) * deviation
        if stands_out != self._stands_out:
            self._stands_out = stands_out
            self.arrow.colors = np.array(ESTIMATED if stands_out else FAINT, dtype=np.uint8)
            self.label.visible = stands_out
        words = f"{force:.2f} N"
        if stands_out and words != self.label.text:
            self.label.text = words

    def _draw_arrow(self, tip: NDArray[np.float64], vector: NDArray[np.float64]) -> None:
        size = max(float(np.linalg.norm(vector)) / SHORTEST, 1e-3)
        scale = min(size, 1.0)
        self.arrow.points = np.array([[np.zeros(3), vector / scale]], dtype=np.float32)
        self.arrow.position = tip
        if scale != self.arrow.scale:
            self.arrow.scale = scale

    def _draw_uncertainty(
        self, half: NDArray[np.float64], directions: NDArray[np.float64], count: int
    ) -> None:
        """Ellipsoid with half axes (3,), m, along the first ``count`` of (3, 3) ``directions``, and
        broken lines along the others.
        """
        cosines = np.abs((directions * self._directions).sum(axis=1))
        same_size = np.abs(half / self._half - 1.0).max() < SAME_SIZE
        if count == self._count and same_size and cosines.min() > SAME_DIRECTION:
            return
        self._half, self._directions, self._count = half, directions, count
        self.ellipsoid.visible = count > 0
        turn = np.ascontiguousarray(directions.T)
        turn[:, 2] *= np.sign(np.linalg.det(turn))
        wxyz = np.empty(4)
        quaternion_from_matrix(turn, wxyz)
        self.ellipsoid.wxyz = wxyz
        self.ellipsoid.scale = (float(half[0]), float(half[1]), float(half[2]))
        shares = np.linspace(-REACH, REACH, 2 * DASHES).reshape(-1, 2, 1)
        lines = [shares * direction for direction in directions[count:]]
        self.unknown.points = np.concatenate(lines or [np.zeros((1, 2, 3))]).astype(np.float32)
