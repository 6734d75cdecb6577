"""The path that plays, whole, where it is asked for: behind the tip and before it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from robot.records import LeaderKind
from server.control.mapped_path import MappedPath
from server.memory.link_records import path_file
from server.scene.palette import DESIRED

ROOT = "/path"
MOST_PIECES = 300
THICKNESS = 1.2


class ScenePath:
    """``/path``: a thin line while a path plays."""

    def __init__(self, server: viser.ViserServer, directory: Path) -> None:
        """Build the line, hidden.

        Args:
            server: draws.
            directory: the run directory, where paths are passed to the control process.
        """
        self._directory = directory
        self._shown = 0
        self.line = server.scene.add_line_segments(
            ROOT,
            np.zeros((1, 2, 3)),
            DESIRED,
            thickness=THICKNESS,
            thickness_units="screen",
            visible=False,
        )

    def update(self, record: Any) -> None:
        """Show the path that plays by what ``record`` says, or hide it."""
        path_id = int(record["header"]["path_id"])
        leader = record["input"]["leader"]
        if path_id == self._shown or (path_id and leader["kind"] != LeaderKind.PATH):
            return
        self._shown = path_id
        points = self._points(path_id, record) if path_id else None
        if points is not None:
            self.line.points = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
        if self.line.visible != (points is not None):
            self.line.visible = points is not None

    def _points(self, path_id: int, record: Any) -> NDArray[np.float64] | None:
        """(n, 3) in the base frame, or None where the path cannot be read, as in a replay."""
        file = self._directory / path_file(path_id)
        try:
            path = MappedPath(file, MappedPath.rows_in(file.stat().st_size), "")
        except (OSError, ValueError):
            return None
        sample = np.empty(7)
        path.at(float(record["header"]["path_progress"]) * path.duration_s, sample)
        start = record["input"]["leader"]["position"] - sample[:3]
        points = np.empty((MOST_PIECES + 1, 3))
        for point, time_s in zip(
            points, np.linspace(0.0, path.duration_s, MOST_PIECES + 1), strict=True
        ):
            path.at(float(time_s), sample)
            point[:] = start + sample[:3]
        return points
