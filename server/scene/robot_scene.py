"""What a robot brings to the picture; the rest of the picture is the same for every robot."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import viser
from numpy.typing import NDArray

from server.scene.camera import Viewpoints
from server.scene.frames import SceneFrames
from server.scene.ground import SceneGround


class RobotScene(ABC):
    """The nodes of one robot.

    Attributes:
        ground: what it stands on.
        frames: axes of the frames that people talk about.
        viewpoints: from where people look at it.
    """

    DRAWN: ClassVar[tuple[str, ...]]
    """Fields of the record's truth that are drawn, and so must be numbers."""
    TURNED_BY_GIZMO: ClassVar[bool]
    """Whether the gizmo turns the tip, or only moves it."""

    ground: SceneGround
    frames: SceneFrames
    viewpoints: Viewpoints

    @abstractmethod
    def work(self, record: Any | None) -> tuple[NDArray[Any], ...]:
        """What ``viewpoints`` look at, as a record says, or at the start without one."""

    @abstractmethod
    def draw(self, now: float, record: Any) -> None:
        """Send what a record changes; called inside of one atomic message.

        Args:
            now: monotonic time, s.
            record: the newest one.
        """

    @abstractmethod
    def gizmo_pose(self, outcome: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Where the gizmo rests: (3,) m and (4,), as (1,) ``outcome`` says."""

    @abstractmethod
    def prepare(self, now: float) -> None:
        """Take in what stands beside the records; before :meth:`draw`, and may take its time."""

    @abstractmethod
    def add_controls(self, gui: viser.GuiApi) -> None:
        """Add what only this robot has to the scene's panel."""
