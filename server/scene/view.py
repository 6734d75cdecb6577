"""The picture of the robot in every connected browser, thirty times a second.

One thread reads the newest record and sends what changed; what belongs to one robot stands behind
:class:`server.scene.robot_scene.RobotScene`, and the modules beside this one each draw one thing.
Nothing here decides anything: the gizmo hands its samples to the link.
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

from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.records import Safety
from server.scene.camera import SceneCamera
from server.scene.concentric_scene import ConcentricScene
from server.scene.gizmo import GizmoLink, SceneGizmo
from server.scene.instrument_scene import InstrumentScene
from server.scene.panel import ScenePanel
from server.scene.path_line import ScenePath
from server.scene.robot_scene import RobotScene
from server.scene.trails import SceneTrails

PERIOD = 1.0 / 30.0
UNWATCHED_PERIOD = 1.0
"""Between two pictures while no browser is connected, s: the next one starts nearly right."""

_MOST_FAILURES = 8

log = logging.getLogger(__name__)


class SceneLink(GizmoLink, Protocol):
    """The part of :class:`server.memory.link.WebLink` that the view uses."""

    directory: Path
    """The run directory."""

    def snapshot(self) -> NDArray[Any]:
        """The newest record, shape (1,), of the robot's types."""

    def status(self) -> dict[str, Any]:
        """What changes rarely; only ``board`` is used here, the name of the one that is there."""


class SceneView:
    """Draws the newest record until stopped.

    Attributes:
        robot: the nodes of the robot that the configuration chooses.
        gizmo: the one at the led tip.
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
            model_directory: of the instrument, see
                :class:`server.scene.instrument_scene.InstrumentScene`.

        Raises:
            OSError: a file of the model cannot be read.
        """
        self._server, self._link = server, link
        with server.atomic():
            self.robot = _scene_of(server, configuration, link, model_directory)
            self._trails = SceneTrails(server)
            self._path = ScenePath(server, link.directory)
            self._camera = SceneCamera(server, self.robot.viewpoints, *self.robot.work(None))
            self.gizmo = SceneGizmo(
                server,
                link,
                configuration.teleoperation.gizmo_timeout_ms * 1e-3,
                turns=self.robot.TURNED_BY_GIZMO,
            )
            ScenePanel(server, self.robot, self._camera, self._trails)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._drawn = -np.inf
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
        _check_drawable(truth, self.robot.DRAWN)
        self._trails.update(now, report["desired_position"], truth["position"], draw=watched)
        if not watched and now - self._drawn < UNWATCHED_PERIOD:
            return
        self._drawn = now
        self.robot.prepare(now)
        with self._server.atomic():
            self._draw(now, record)

    def _draw(self, now: float, record: Any) -> None:
        self.robot.draw(now, record)
        self._path.update(record)
        self._camera.update(*self.robot.work(record))
        enabled = record["outcome"]["state"]["safety"] == Safety.ENABLED
        position, wxyz = self.robot.gizmo_pose(np.array([record["outcome"]]))
        self.gizmo.update(now, position, wxyz, ready=bool(enabled))


def _scene_of(
    server: viser.ViserServer,
    configuration: Configuration,
    link: SceneLink,
    model_directory: Path | None,
) -> RobotScene:
    """Build the nodes of the robot that ``configuration`` chooses."""
    if configuration.robot == "concentric":
        return ConcentricScene(server, configuration)
    return InstrumentScene(server, configuration, link.status, model_directory)


def _check_drawable(truth: Any, fields: tuple[str, ...]) -> None:
    """A browser that is sent what is no number shows nothing, and says nothing."""
    for field in fields:
        if not np.isfinite(truth[field]).all():
            raise FloatingPointError(f"the robot's {field} is no number")
