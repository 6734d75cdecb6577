"""Where people look at the instrument from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from server.scene.camera import UP, View, Viewpoints

OVERVIEW, INSTRUMENT, BOARD, ALONG = "Overview", "Instrument", "Board", "Along the shaft"


def named_view(
    name: str, trocar: NDArray[np.float64], tip: NDArray[np.float64], inward: NDArray[np.float64]
) -> View:
    """Where to look from.

    Args:
        name: one of the names of :data:`VIEWPOINTS`.
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


VIEWPOINTS = Viewpoints((OVERVIEW, INSTRUMENT, BOARD, ALONG), INSTRUMENT, named_view)
