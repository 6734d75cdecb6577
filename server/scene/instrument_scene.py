"""The picture of the instrument: arm, shaft and segment, trocar, and the board before them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from frontend_assets.robot_model import ensure_model
from robot.compiled import cache_directory
from robot.configuration import Configuration
from robot.rotations import angle_between, matrix_from_quaternion
from robot.segment import tip_rotation
from robot.sensing.tip_correction import expected_pose
from robot.urdf import FLANGE
from scenes.boards.board import BOARD_NAMES, board
from server.scene.board import FLOOR, SceneBoard
from server.scene.frames import ROOT as FRAMES
from server.scene.frames import Axes, SceneFrames
from server.scene.ghost import SceneGhost
from server.scene.ground import SceneGround
from server.scene.instrument_views import VIEWPOINTS
from server.scene.palette import PLINTH
from server.scene.robot import SceneRobot
from server.scene.robot_scene import RobotScene
from server.scene.segment import SceneSegment
from server.scene.sensed import SceneSensed
from server.scene.shapes import Mesh, round_bar
from server.scene.trocar import ROOT as TROCAR
from server.scene.trocar import WALL_OPACITY, SceneTrocar

BOARD_PERIOD = 0.5
"""Between two looks at which board is there, s."""
PLINTH_RADIUS = 0.08


class InstrumentScene(RobotScene):
    """Arm, instrument, trocar and board.

    Attributes:
        arm: nodes of the arm's links.
        board: what is before the instrument.
    """

    DRAWN = ("q", "uv", "position", "wxyz", "shaft_base", "shaft_end")
    TURNED_BY_GIZMO = True

    def __init__(
        self,
        server: viser.ViserServer,
        configuration: Configuration,
        status: Callable[[], dict[str, Any]],
        model_directory: Path | None = None,
    ) -> None:
        """Build the nodes as they stand before the first record.

        Args:
            server: draws.
            configuration: dimensions and where things start.
            status: tells what changes rarely; only ``board`` is used.
            model_directory: holds ``keyhole.urdf`` and its meshes; without it, the ones that
                belong to the configuration are found, or built once and kept.

        Raises:
            OSError: a file of the model cannot be read.
        """
        if model_directory is None:
            model_directory = ensure_model(configuration, cache_directory().parent)
        self._configuration, self._status = configuration, status
        self._looked = -np.inf
        self.viewpoints = VIEWPOINTS
        self.ground = SceneGround(server, (0.2, 0.0, FLOOR), 0.05, 3.0)
        # A hair below the arm's base, so that the two surfaces do not fight for the same pixels.
        plinth = round_bar(FLOOR + 0.0005, -0.0005, PLINTH_RADIUS, 0.004, 64)
        server.scene.add_mesh_simple("/ground/plinth", plinth.vertices, plinth.faces, color=PLINTH)
        joints = [joint.name for joint in configuration.arm.joints]
        self.arm = SceneRobot(server, model_directory, joints)
        self._segment = SceneSegment(server, configuration.instrument)
        self._sensed = SceneSensed(server, configuration)
        self._trocar = SceneTrocar(server, configuration)
        self.board = SceneBoard(server, configuration.instrument)
        self.board.show(board(configuration.simulation.board, configuration))
        radius = configuration.instrument.disk_diameter_m / 2
        self._ghost = SceneGhost(server, "/ghost", _ghost_tip(radius), 4.0 * radius)
        self.frames = SceneFrames(
            server,
            "Axes of base, flange, trocar and tip",
            [Axes(f"{FRAMES}/tip", 0.014, 0.0004, "tip")],
            [
                Axes(f"{FRAMES}/base", 0.12, 0.002, "base"),
                Axes(f"{self.arm.paths[FLANGE]}/axes", 0.09, 0.0015, "flange"),
                Axes(f"{TROCAR}/axes", 0.03, 0.0005),
            ],
        )

    def work(self, record: Any | None) -> tuple[NDArray[Any], ...]:
        """Trocar, tip, and unit direction of the shaft toward the tip."""
        if record is None:
            start, instrument = self._configuration.start, self._configuration.instrument
            trocar = np.array(self._configuration.trocar.position_m)
            inward = np.array(start.shaft_direction)
            inward /= np.linalg.norm(inward)
            inside = 1.0 - start.lambda_along_shaft
            return trocar, trocar + inside * instrument.shaft_length_m * inward, inward
        truth = record["truth"]
        inward = truth["shaft_end"] - truth["shaft_base"]
        trocar = np.array(record["input"]["trocar_position"])
        return trocar, truth["position"], inward / np.linalg.norm(inward)

    def prepare(self, now: float) -> None:
        """Show the board that the robot has before it, when it has changed."""
        if now - self._looked < BOARD_PERIOD:
            return
        self._looked = now
        name = self._status()["board"]
        if name != self.board.name and name in BOARD_NAMES:
            self.board.show(board(name, self._configuration))

    def draw(self, now: float, record: Any) -> None:
        """Send what a record changes."""
        truth, report = record["truth"], record["outcome"]["report"]
        tip = np.empty((3, 3))
        matrix_from_quaternion(truth["wxyz"], tip)
        bend = np.empty((3, 3))
        tip_rotation(float(truth["uv"][0]), float(truth["uv"][1]), bend)
        trocar, position, inward = self.work(record)
        self.arm.update(truth["q"])
        self._segment.update(truth["shaft_end"], tip @ bend.T, truth["uv"], truth["position"])
        self._sensed.update(now, report)
        self.board.update(now, truth, tip @ bend.T)
        self._trocar.update(trocar, -inward)
        self.frames.update((position, truth["wxyz"]))
        desired = np.empty((3, 3))
        matrix_from_quaternion(report["desired_wxyz"], desired)
        away = float(np.linalg.norm(report["desired_position"] - position))
        turned = angle_between(desired, tip)
        self._ghost.update(now, report["desired_position"], report["desired_wxyz"], (away, turned))

    def gizmo_pose(self, outcome: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """At the tip as it is expected to be."""
        position, wxyz = np.empty(3), np.empty(4)
        expected_pose(outcome, position, wxyz)
        return position, wxyz

    def add_controls(self, gui: viser.GuiApi) -> None:
        """How much of the body wall is seen."""
        opacity = gui.add_slider(
            "Wall opacity",
            min=0.0,
            max=1.0,
            step=0.05,
            initial_value=WALL_OPACITY,
            hint="Of the body wall: 0 hides it, 1 is opaque",
        )

        @opacity.on_update
        async def _(_: object) -> None:
            self._trocar.fade(opacity.value)


def _ghost_tip(radius: float) -> Mesh:
    """The last piece of the segment, a little wider than it is."""
    return round_bar(-3.4 * radius, 0.12 * radius, 1.15 * radius, 0.25 * radius, 32)
