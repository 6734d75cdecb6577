"""The picture of the robot in every connected browser, thirty times a second.

One thread reads the newest record and sends what changed; the modules ``scene_*`` beside this one
each draw one thing. Nothing here decides anything: the gizmo hands its samples to the link.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import viser
from numpy.typing import NDArray

from frontend_assets.robot_model import ensure_model
from robot.compiled import cache_directory
from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.records import Safety
from robot.rotations import angle_between, matrix_from_quaternion
from robot.segment import tip_rotation
from robot.sensing.tip_correction import expected_pose
from robot.urdf import FLANGE
from scenes.boards.board import BOARD_NAMES, board
from server.scene.board import SceneBoard
from server.scene.camera import SceneCamera
from server.scene.frames import SceneFrames
from server.scene.ghost import SceneGhost
from server.scene.gizmo import GizmoLink, SceneGizmo
from server.scene.ground import SceneGround
from server.scene.panel import ScenePanel
from server.scene.robot import SceneRobot
from server.scene.segment import SceneSegment
from server.scene.trails import SceneTrails
from server.scene.trocar import ROOT as TROCAR
from server.scene.trocar import SceneTrocar

PERIOD = 1.0 / 30.0
UNWATCHED_PERIOD = 1.0
"""Between two pictures while no browser is connected, s: the next one starts nearly right."""
BOARD_PERIOD = 0.5
"""Between two looks at which board is there, s."""

_MOST_FAILURES = 8

log = logging.getLogger(__name__)


class SceneLink(GizmoLink, Protocol):
    """The part of :class:`server.memory.link.WebLink` that the view uses."""

    def snapshot(self) -> NDArray[Any]:
        """The newest record, shape (1,), :data:`robot.records.RECORD`."""

    def status(self) -> dict[str, Any]:
        """What changes rarely; only ``board`` is used here, the name of the one that is there."""


class SceneView:
    """Draws the newest record until stopped.

    Attributes:
        on_failure: called from its thread with the first failure of each kind, in words.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        configuration: Configuration,
        link: SceneLink,
        model_directory: Path | None = None,
    ) -> None:
        """Build the whole scene, as it stands before the first record.

        Args:
            server: draws; stays the caller's to stop.
            configuration: dimensions and where things start.
            link: records come from it, gizmo samples go to it.
            model_directory: holds ``keyhole.urdf`` and its meshes; without it, the ones that
                belong to the configuration are found, or built once and kept.

        Raises:
            OSError: a file of the model cannot be read.
        """
        if model_directory is None:
            model_directory = ensure_model(configuration, cache_directory().parent)
        self._server, self._link, self._configuration = server, link, configuration
        trocar = np.array(configuration.trocar.position_m)
        inward = np.array(configuration.start.shaft_direction)
        inward /= np.linalg.norm(inward)
        inside = 1.0 - configuration.start.lambda_along_shaft
        tip = trocar + inside * configuration.instrument.shaft_length_m * inward
        joints = [joint.name for joint in configuration.arm.joints]
        with server.atomic():
            self._ground = SceneGround(server)
            self._robot = SceneRobot(server, model_directory, joints)
            self._segment = SceneSegment(server, configuration.instrument)
            self._trocar = SceneTrocar(server, configuration)
            self.board = SceneBoard(server, configuration.instrument)
            self.board.show(board(configuration.simulation.board, configuration))
            self._trails = SceneTrails(server)
            self._ghost = SceneGhost(server, configuration.instrument)
            self._frames = SceneFrames(server, self._robot.paths[FLANGE], TROCAR)
            self._camera = SceneCamera(server, trocar, tip, inward)
            self.gizmo = SceneGizmo(
                server, link, configuration.teleoperation.gizmo_timeout_ms * 1e-3
            )
            ScenePanel(server, self._camera, self._frames, self._trails, self._trocar, self._ground)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._drawn = self._looked = -np.inf
        self._failures: set[str] = set()
        self.on_failure: Callable[[str], None] = lambda _: None

    def start(self) -> None:
        """Draw from a thread of its own."""
        self._thread = threading.Thread(target=self._run, name="scene", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and open the gizmo's clutch; harmless when not started."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=2.0)
        self.gizmo.release()

    def _run(self) -> None:
        deadline = time.monotonic()
        while not self._stop.is_set():
            try:
                self.step(time.monotonic())
            except KeyholeError as error:
                log.debug("no picture: %s", error)
            except Exception as error:
                # One bad picture must not end the rest; a held gizmo goes stale by itself.
                self._tell(error)
            deadline = max(deadline + PERIOD, time.monotonic())
            self._stop.wait(deadline - time.monotonic())

    def _tell(self, error: Exception) -> None:
        """Tell a failure; of each kind only the first, of a few kinds."""
        kind = type(error).__name__
        if kind in self._failures or len(self._failures) > _MOST_FAILURES:
            return
        self._failures.add(kind)
        log.exception("the scene could not be drawn; told once")
        self.on_failure(f"{kind}: {error}"[:200])

    def step(self, now: float) -> None:
        """Draw the newest record once.

        Args:
            now: monotonic time, s.

        Raises:
            KeyholeError: the link has no whole record to give.
            FloatingPointError: what should be drawn is no number.
        """
        clients = set(self._server.get_clients())
        self.gizmo.release_unless(clients)
        snapshot = self._link.snapshot()
        record = snapshot[0]
        if record["header"]["tick"] <= 0:
            return
        watched = bool(clients)
        truth, report = record["truth"], record["outcome"]["report"]
        _check_drawable(truth)
        self._trails.update(now, report["desired_position"], truth["position"], draw=watched)
        if not watched and now - self._drawn < UNWATCHED_PERIOD:
            return
        self._drawn = now
        self._find_board(now)
        with self._server.atomic():
            self._draw(now, record)

    def _find_board(self, now: float) -> None:
        """Show the board that the robot has before it, when it has changed."""
        if now - self._looked < BOARD_PERIOD:
            return
        self._looked = now
        name = self._link.status()["board"]
        if name != self.board.name and name in BOARD_NAMES:
            self.board.show(board(name, self._configuration))

    def _draw(self, now: float, record: Any) -> None:
        truth, report = record["truth"], record["outcome"]["report"]
        tip = np.empty((3, 3))
        matrix_from_quaternion(truth["wxyz"], tip)
        bend = np.empty((3, 3))
        tip_rotation(float(truth["uv"][0]), float(truth["uv"][1]), bend)
        trocar = np.array(record["input"]["trocar_position"])
        inward = truth["shaft_end"] - truth["shaft_base"]
        inward = inward / np.linalg.norm(inward)
        self._robot.update(truth["q"])
        self._segment.update(truth["shaft_end"], tip @ bend.T, truth["uv"])
        self.board.update(now, truth, tip @ bend.T)
        self._trocar.update(trocar, -inward)
        self._frames.update(truth["position"], truth["wxyz"])
        self._camera.update(trocar, truth["position"], inward)
        desired = np.empty((3, 3))
        matrix_from_quaternion(report["desired_wxyz"], desired)
        away = float(np.linalg.norm(report["desired_position"] - truth["position"]))
        turned = angle_between(desired, tip)
        self._ghost.update(now, report["desired_position"], report["desired_wxyz"], (away, turned))
        enabled = record["outcome"]["state"]["safety"] == Safety.ENABLED
        position, wxyz = np.empty(3), np.empty(4)
        expected_pose(np.array([record["outcome"]]), position, wxyz)
        self.gizmo.update(now, position, wxyz, ready=bool(enabled))


def _check_drawable(truth: Any) -> None:
    """A browser that is sent what is no number shows nothing, and says nothing."""
    parts = ("q", "uv", "position", "wxyz", "shaft_base", "shaft_end")
    for part in parts:
        if not np.isfinite(truth[part]).all():
            raise FloatingPointError(f"the robot's {part} is no number")
