"""Which robot the supervisor shall start instead of the one that is driven: a file of one word."""

from __future__ import annotations

import os
from pathlib import Path

from robot.robots import TITLES

_FILE = "robot.selected"


class RobotSelection:
    """Written by web, taken by the supervisor.

    Args:
        directory: the run directory.
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / _FILE

    def ask(self, robot: str) -> None:
        """Have the robot of that name started in place of the present one."""
        unfinished = self._path.with_name(f".{_FILE}.new")
        unfinished.write_text(robot)
        unfinished.chmod(0o600)
        os.replace(unfinished, self._path)

    def take(self) -> str | None:
        """The name that was asked for since the last call, or None."""
        try:
            robot = self._path.read_text()
            self._path.unlink()
        except OSError:
            return None
        return robot if robot in TITLES else None
