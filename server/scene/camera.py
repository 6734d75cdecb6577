"""Where people look from: the first view of every browser, and the named ones."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

FIELD_OF_VIEW = 0.70
"""Vertical, rad: narrow enough to keep the shaft straight-looking near the edges."""
NEAR, FAR = 0.004, 60.0
UP = (0.0, 0.0, 1.0)
HOME_STEP = 0.02
"""The first view is set anew when what is looked at moved by more than this, m."""


class View(NamedTuple):
    """Camera position and the point it looks at, m, world; which way is up on the screen."""

    position: NDArray[np.float64]
    look_at: NDArray[np.float64]
    up: tuple[float, float, float] = UP


class Viewpoints(NamedTuple):
    """Named views of one robot.

    Attributes:
        names: of all.
        home: name of the first view of every browser; its up is :data:`UP`.
        view: the view of a name, given the arrays (3,) that say where the work is.
    """

    names: tuple[str, ...]
    home: str
    view: Callable[..., View]


class SceneCamera:
    """Keeps the first view on the work, and takes single browsers to named views."""

    def __init__(
        self, server: viser.ViserServer, viewpoints: Viewpoints, *work: NDArray[np.float64]
    ) -> None:
        """Set the first view.

        Args:
            server: draws.
            viewpoints: of the robot.
            work: arrays (3,) for ``viewpoints.view``.
        """
        self.viewpoints = viewpoints
        self._initial = server.initial_camera
        self._initial.fov = FIELD_OF_VIEW
        self._initial.near = NEAR
        self._initial.far = FAR
        self._lock = threading.Lock()
        self._work = work
        self._home = np.full(3 * len(work), np.inf)
        self.update(*work)

    def update(self, *work: NDArray[np.float64]) -> None:
        """Take in where the work is: arrays (3,) for ``viewpoints.view``."""
        with self._lock:
            self._work = tuple(np.array(part) for part in work)
        here = np.concatenate(work)
        if np.abs(here - self._home).max() < HOME_STEP:
            return
        self._home[:] = here
        view = self.viewpoints.view(self.viewpoints.home, *self._work)
        self._initial.position = view.position
        self._initial.look_at = view.look_at

    def show(self, client: viser.ClientHandle, name: str) -> None:
        """Take one browser to a named view."""
        with self._lock:
            view = self.viewpoints.view(name, *self._work)
        with client.atomic():
            client.camera.up_direction = view.up
            client.camera.position = view.position
            client.camera.look_at = view.look_at
