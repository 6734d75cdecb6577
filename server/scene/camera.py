"""Where people look from: the first view of every browser, and the named ones."""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

FIELD_OF_VIEW = 0.70
"""Vertical, rad: narrow enough to keep the shaft straight-looking near the edges."""
NEAR, FAR = 0.004, 60.0
UP = (0.0, 0.0, 1.0)
HOME_STEP = 0.02
"""The first view is set anew when tip or trocar moved by more than this, m."""

OVERVIEW, INSTRUMENT, BOARD, ALONG = "Overview", "Instrument", "Board", "Along the shaft"
NAMES = (OVERVIEW, INSTRUMENT, BOARD, ALONG)


class View(NamedTuple):
    """Camera position and the point it looks at, m, world."""

    position: NDArray[np.float64]
    look_at: NDArray[np.float64]


def named_view(
    name: str, trocar: NDArray[np.float64], tip: NDArray[np.float64], inward: NDArray[np.float64]
) -> View:
    """Where to look from.

    Args:
        name: one of :data:`NAMES`.
        trocar: (3,) RCM, m.
        tip: (3,) tip, m.
        inward: (3,) unit direction of the shaft, toward the tip.

    Returns:
        The view.
    """
    if name == OVERVIEW:
        look_at = np.array([0.45 * trocar[0], 0.45 * trocar[1], 0.24])
        return View(look_at + np.array([1.05, -1.25, 0.55]), look_at)
    up = np.array(UP)
    forward = inward - (inward @ up) * up
    length = np.linalg.norm(forward)
    forward = forward / length if length > 1e-3 else np.array([1.0, 0.0, 0.0])
    sideways = np.cross(forward, up)
    if name == ALONG:
        # Below the wall, as an endoscope through a second port would see it.
        look_at = tip + 0.02 * inward
        return View(trocar + 0.012 * inward + 0.06 * sideways - 0.006 * up, look_at)
    if name == BOARD:
        look_at = tip + 0.015 * forward - 0.008 * up
        return View(look_at + 0.11 * sideways + 0.10 * forward + 0.09 * up, look_at)
    look_at = 0.55 * trocar + 0.45 * tip
    return View(look_at + 0.37 * sideways + 0.36 * forward + 0.17 * up, look_at)


class SceneCamera:
    """Keeps the first view on the work, and takes single browsers to named views."""

    def __init__(
        self,
        server: viser.ViserServer,
        trocar: NDArray[np.float64],
        tip: NDArray[np.float64],
        inward: NDArray[np.float64],
    ) -> None:
        """Set the first view; arguments as for :func:`named_view`."""
        self._initial = server.initial_camera
        self._initial.fov = FIELD_OF_VIEW
        self._initial.near = NEAR
        self._initial.far = FAR
        self._lock = threading.Lock()
        self._work = (np.array(trocar), np.array(tip), np.array(inward))
        self._home = np.full(6, np.inf)
        self.update(trocar, tip, inward)

    def update(
        self,
        trocar: NDArray[np.float64],
        tip: NDArray[np.float64],
        inward: NDArray[np.float64],
    ) -> None:
        """Take in where the work is; arguments as for :func:`named_view`."""
        with self._lock:
            self._work = (np.array(trocar), np.array(tip), np.array(inward))
        here = np.concatenate([trocar, tip])
        if np.abs(here - self._home).max() < HOME_STEP:
            return
        self._home[:] = here
        view = named_view(INSTRUMENT, *self._work)
        self._initial.position = view.position
        self._initial.look_at = view.look_at

    def show(self, client: viser.ClientHandle, name: str) -> None:
        """Take one browser to a named view."""
        with self._lock:
            view = named_view(name, *self._work)
        with client.atomic():
            client.camera.up_direction = UP
            client.camera.position = view.position
            client.camera.look_at = view.look_at
