"""The picture of the two concentric-tube arms and the endoscope they come out of."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from robot.concentric.concentric_robot import ARMS
from robot.concentric.pair import ArmPair, start_of
from robot.configuration import Configuration
from server.scene.concentric_views import VIEWPOINTS
from server.scene.endoscope import OPACITY, SceneEndoscope
from server.scene.frames import ROOT as FRAMES
from server.scene.frames import Axes, SceneFrames
from server.scene.ghost import SceneGhost
from server.scene.ground import SceneGround
from server.scene.relative import GHOST_RADIUS, SceneRelative
from server.scene.robot_scene import RobotScene
from server.scene.shapes import ball
from server.scene.snapping import SceneSnapping
from server.scene.tubes import WIDTH, SceneTubes

FLOOR = -0.12
"""Height of the grid behind the endoscope, m."""
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class ConcentricScene(RobotScene):
    """Endoscope, both arms, and what B keeps beside A. The base frame lies in the face, z out.

    Attributes:
        tubes: both arms.
        relative: the vector from A's tip to B's.
        snapping: warnings.
    """

    DRAWN = ("q", "torsion", "position", "wxyz", "position_b", "wxyz_b")
    TURNED_BY_GIZMO = False

    def __init__(self, server: viser.ViserServer, configuration: Configuration) -> None:
        """Build the nodes, roughly where the arms stand at the start.

        Args:
            server: draws.
            configuration: dimensions, limits and start.
        """
        design = configuration.concentric
        start = start_of(design.starts[design.start - 1])
        self._reach = 1e-3 * design.tubes[0].length_mm + start[[0, start.size // 2]]
        self._channels = ArmPair(design).channels
        self.viewpoints = VIEWPOINTS
        self.ground = SceneGround(server, (0.0, 0.0, FLOOR), 0.01, 1.0)
        outermost = 0.5e-3 * design.tubes[-1].outer_diameter_mm
        mouths = tuple((float(x), float(y), float(z)) for x, y, z in self._channels)
        self._endoscope = SceneEndoscope(server, design, mouths, WIDTH * outermost)
        self.tubes = SceneTubes(server, design, start)
        self._ghost = SceneGhost(server, "/ghost", ball(GHOST_RADIUS))
        self.relative = SceneRelative(server, design.limits.relative_error_mm * 1e-3)
        self.snapping = SceneSnapping(server, design.limits.stability_margin, ARMS)
        self.frames = SceneFrames(
            server,
            "Axes of the endoscope's face and of both tips",
            [
                Axes(f"{FRAMES}/tip A", 0.012, 0.0003, "A", "center-right"),
                Axes(f"{FRAMES}/tip B", 0.012, 0.0003, "B", "center-left"),
            ],
            [Axes(f"{FRAMES}/face", 0.02, 0.0004)],
        )
        self.frames.visible = True

    def work(self, record: Any | None) -> tuple[NDArray[Any], ...]:
        """A's tip and B's tip."""
        if record is None:
            # How far they are out; where they bend to is not known before the first record.
            ahead = np.outer(self._reach, [0.0, 0.0, 1.0]) + self._channels
            return ahead[0], ahead[1]
        truth = record["truth"]
        return truth["position"], truth["position_b"]

    def prepare(self, now: float) -> None:
        """Nothing stands beside the records."""

    def draw(self, now: float, record: Any) -> None:
        """Send what a record changes."""
        truth, outcome = record["truth"], record["outcome"]
        report, state = outcome["report"], outcome["state"]
        tip_a, tip_b = truth["position"], truth["position_b"]
        self.tubes.update(truth["q"], truth["torsion"])
        self.tubes.update_commanded(now, report["q"], state["torsion"], truth["q"])
        self.frames.update((tip_a, truth["wxyz"]), (tip_b, truth["wxyz_b"]))
        self.relative.update(now, tip_a, tip_b, report["desired_b"])
        self.snapping.update(report["stability"], np.array([tip_a, tip_b]))
        away = float(np.linalg.norm(report["desired_position"] - tip_a))
        self._ghost.update(now, report["desired_position"], UPRIGHT, (away, 0.0))

    def gizmo_pose(self, outcome: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """At A's tip, along the base frame: it moves the tip and does not turn it."""
        return outcome["report"]["commanded_position"][0], UPRIGHT

    def add_controls(self, gui: viser.GuiApi) -> None:
        """How thick the tubes are drawn, and how much of the endoscope is seen."""
        width = gui.add_slider(
            "Tube width",
            min=1.0,
            max=4.0,
            step=0.5,
            initial_value=WIDTH,
            hint="Tubes are drawn so many times thicker than they are",
        )
        opacity = gui.add_slider(
            "Endoscope opacity",
            min=0.0,
            max=1.0,
            step=0.05,
            initial_value=OPACITY,
            hint="0 hides it, 1 is opaque",
        )

        @width.on_update
        async def _(_: object) -> None:
            self.tubes.width = width.value

        @opacity.on_update
        async def _(_: object) -> None:
            self._endoscope.fade(opacity.value)
