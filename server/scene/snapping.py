"""A warning in words at an arm whose tubes are about to snap."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

ROOT = "/snapping"
NEAR = 3.0
"""Warned below so many times the stability that is not approached."""
GONE = 1.2
"""The warning goes above so many times the stability at which it came; so it does not flicker."""


class SceneSnapping:
    """``/snapping``: one label for each arm, hidden while its tubes are far from snapping."""

    def __init__(self, server: viser.ViserServer, margin: float, arms: tuple[str, ...]) -> None:
        """Build the labels.

        Args:
            server: draws.
            margin: stability that motion does not go below.
            arms: their names.
        """
        self._margin, self._arms = margin, arms
        server.scene.add_frame(ROOT, show_axes=False)
        self.labels = [
            server.scene.add_label(
                f"{ROOT}/{arm}", "", font_screen_scale=0.9, anchor="bottom-right", visible=False
            )
            for arm in arms
        ]

    def update(self, stability: NDArray[np.float64], tips: NDArray[np.float64]) -> None:
        """Show or hide the warnings.

        Args:
            stability: (arms,) determinants, 1 far from snapping, 0 where the tubes snap.
            tips: (arms, 3) m.
        """
        for label, arm, value, tip in zip(self.labels, self._arms, stability, tips, strict=True):
            shown = value < NEAR * self._margin * (GONE if label.visible else 1.0)
            if shown:
                words = f"⚠ {arm} is near snapping: stability {value:.2f}, limit {self._margin:g}"
                if label.text != words:
                    label.text = words
                    label.position = tip
            if shown != label.visible:
                label.visible = shown
