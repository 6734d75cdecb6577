"""Where people look at the two concentric-tube arms from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from server.scene.camera import FIELD_OF_VIEW, View, Viewpoints

OVERVIEW, TIPS, SIDE, ENDOSCOPE = "Overview", "Tips", "Side", "Endoscope"
AHEAD = np.array([0.0, 0.0, 0.08])
"""The gizmo's arrow at A's tip is in view too, m."""
REAR = np.array([0.0, 0.0, -0.075])
"""What is still to be seen behind the face, m."""
ROOM = 1.06
"""How much more than the arms is in view."""

_FROM = {OVERVIEW: (0.35, -1.0, 0.5), SIDE: (1.0, -0.12, 0.3), TIPS: (0.35, -1.0, 0.6)}
_TIPS_AROUND = 0.045


def named_view(name: str, tip_a: NDArray[np.float64], tip_b: NDArray[np.float64]) -> View:
    """Where to look from, A on the left.

    Args:
        name: one of the names of :data:`VIEWPOINTS`.
        tip_a: (3,) A's tip, m.
        tip_b: (3,) B's tip, m.
    """
    tips = 0.5 * (tip_a + tip_b)
    if name == ENDOSCOPE:
        # As the endoscope sees it; its z axis goes into the picture, so up is another.
        return View(np.array([0.0, -0.008, -0.001]), tips, (0.0, -1.0, 0.0))
    across = np.array(_FROM[name]) / np.linalg.norm(_FROM[name])
    if name == TIPS:
        around = max(_TIPS_AROUND, float(np.linalg.norm(tip_b - tip_a)))
        return View(tips + around / np.sin(FIELD_OF_VIEW / 2) * across, tips)
    seen = np.array([tip_a, tip_a + AHEAD, tip_b, REAR])
    low, high = seen.min(axis=0), seen.max(axis=0)
    look_at, half = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    return View(look_at + ROOM * half / np.sin(FIELD_OF_VIEW / 2) * across, look_at)


VIEWPOINTS = Viewpoints((OVERVIEW, TIPS, SIDE, ENDOSCOPE), OVERVIEW, named_view)
