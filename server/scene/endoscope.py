"""The endoscope: what lies behind its face, and the two channels that the arms come out of."""

from __future__ import annotations

import viser

from robot.concentric.design import Concentric
from server.scene.palette import CHANNEL, ENDOSCOPE
from server.scene.shapes import merge, revolve, ring

ROOT = "/endoscope"
OPACITY = 0.5
RIM = 0.0016
CHANNEL_GAP = 0.0012
"""Between the outermost tube as drawn and its channel's wall, m."""


class SceneEndoscope:
    """Nodes below ``/endoscope``, whose frame stands in the middle of the face, z out of it."""

    def __init__(
        self,
        server: viser.ViserServer,
        design: Concentric,
        channels: tuple[tuple[float, float, float], ...],
        tube_radius: float,
    ) -> None:
        """Build the nodes.

        Args:
            server: draws.
            design: dimensions.
            channels: where each ends, m.
            tube_radius: of the outermost tube as drawn, m.
        """
        radius, length = 0.5e-3 * design.endoscope_diameter_mm, 1e-3 * design.endoscope_length_mm
        server.scene.add_frame(ROOT, show_axes=False)
        hull = revolve([(radius, -length), (radius, 0.0), (radius - RIM, 0.0)], 64)
        self.body = server.scene.add_mesh_simple(
            f"{ROOT}/body",
            hull.vertices,
            hull.faces,
            color=ENDOSCOPE,
            opacity=OPACITY,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
        bands = merge(
            ring(radius - RIM, radius + 0.0003, -0.004, 0.0002, 64),
            ring(radius - RIM, radius + 0.0003, -length, -length + 0.003, 64),
        )
        server.scene.add_mesh_simple(f"{ROOT}/bands", bands.vertices, bands.faces, color=ENDOSCOPE)
        bore = tube_radius + CHANNEL_GAP
        mouth = ring(bore, bore + 0.0009, -0.003, 0.0004, 40)
        for index, channel in enumerate(channels):
            server.scene.add_mesh_simple(
                f"{ROOT}/channel {'AB'[index]}",
                mouth.vertices,
                mouth.faces,
                color=CHANNEL,
                position=channel,
            )

    def fade(self, opacity: float) -> None:
        """Set the body's opacity, 0 to 1."""
        self.body.visible = opacity > 0.0
        self.body.opacity = opacity
