"""The gizmo at the tip: one leader among others, and the only thing here that writes.

The browser sends a pose at most twenty times a second and only when it changes. While it is held,
viser's event loop repeats the last pose, so that holding still is not a stale leader, while a
server that no longer listens to the browser is one.
"""

from __future__ import annotations

import asyncio
import threading
from typing import Protocol

import numpy as np
import viser
from numpy.typing import NDArray

from robot.records import LeaderKind

NAME = "/gizmo"
SIZE = 0.06
"""Length of an arrow, m."""
SMOOTHING = 0.05
"""Samples come 50 ms apart; the control interpolates over this (s)."""
REPEAT_PERIOD = 0.025
FOLLOW_PERIOD = 0.1
PUT_BACK_PERIOD = 1.0
READY_OPACITY, RESTING_OPACITY = 0.8, 0.3
PUT_BACK_STEP = np.array([1e-4, 0.0, 0.0])


class GizmoLink(Protocol):
    """Where the gizmo's samples go: the part of :class:`server.memory.link.WebLink` used here."""

    def leader(
        self,
        kind: LeaderKind,
        *,
        sequence: int,
        clutch: bool,
        position: NDArray[np.float64],
        wxyz: NDArray[np.float64],
        absolute: bool,
        smoothing_s: float,
        timeout_s: float,
    ) -> None:
        """Hand over one leader sample (m, unit quaternion, s)."""


class SceneGizmo:
    """``/gizmo``: follows the commanded tip until somebody drags it."""

    def __init__(
        self, server: viser.ViserServer, link: GizmoLink, timeout_s: float, *, turns: bool
    ) -> None:
        """Build the gizmo.

        Args:
            server: draws, and calls back on its event loop.
            link: takes the samples.
            timeout_s: age at which a sample is stale.
            turns: it has rings that turn it, and squares that move it in a plane; otherwise only
                the arrows, which hide less of what is near the tip.
        """
        self._link = link
        self._timeout = timeout_s
        self._lock = threading.Lock()
        self._client: int | None = None
        self._sequence = 0
        self._position = np.zeros(3)
        self._wxyz = np.array([1.0, 0.0, 0.0, 0.0])
        self._timer: asyncio.TimerHandle | None = None
        self._followed = 0.0
        self._put_back = 0.0
        self.control = server.scene.add_transform_controls(
            NAME,
            scale=SIZE,
            line_width=3.0,
            disable_rotations=not turns,
            disable_sliders=not turns,
            depth_test=False,
            opacity=RESTING_OPACITY,
        )
        self.control.on_update(self._on_update)

    @property
    def dragging(self) -> bool:
        """Whether somebody holds the gizmo."""
        return self._client is not None

    async def _on_update(self, event: viser.TransformControlsEvent) -> None:
        # A coroutine without awaits: viser runs these in the order of arrival.
        with self._lock:
            if self._client is None and event.phase == "start":
                self._client = event.client_id
                self._repeat_later()
            if self._client != event.client_id:
                return
            self._position[:] = event.target.position
            self._wxyz[:] = event.target.wxyz
            self._send(clutch=event.phase != "end")
            if event.phase == "end":
                self._client = None
                self._followed = self._put_back = 0.0

    def _repeat_later(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(REPEAT_PERIOD, self._repeat)

    def _repeat(self) -> None:
        with self._lock:
            if self._client is not None:
                self._repeat_later()
                self._send(clutch=True)

    def _send(self, *, clutch: bool) -> None:
        self._sequence += 1
        self._link.leader(
            LeaderKind.GIZMO,
            sequence=self._sequence,
            clutch=clutch,
            position=self._position.copy(),
            wxyz=self._wxyz.copy(),
            absolute=False,
            smoothing_s=SMOOTHING,
            timeout_s=self._timeout,
        )

    def update(
        self,
        now: float,
        position: NDArray[np.float64],
        wxyz: NDArray[np.float64],
        *,
        ready: bool,
    ) -> None:
        """Follow the commanded tip, unless somebody holds the gizmo.

        A watcher's drag moves only the watcher's own picture (nothing of it arrives here), so the
        pose is written anew once a second even when it did not change.

        Args:
            now: s.
            position: (3,) commanded tip, m.
            wxyz: (4,) commanded tip.
            ready: motion is enabled; otherwise the gizmo is pale.
        """
        with self._lock:
            if self._client is not None or now - self._followed < FOLLOW_PERIOD:
                return
            self._followed = now
            if now - self._put_back >= PUT_BACK_PERIOD:
                self._put_back = now
                self.control.position = position + PUT_BACK_STEP
                self.control.wxyz = -wxyz
            self.control.position = position
            self.control.wxyz = wxyz
            opacity = READY_OPACITY if ready else RESTING_OPACITY
            if self.control.opacity != opacity:
                self.control.opacity = opacity

    def release(self) -> None:
        """Open the clutch if it is closed: the view ends or its client has gone."""
        with self._lock:
            if self._client is not None:
                self._client = None
                self._send(clutch=False)

    def release_unless(self, clients: set[int]) -> None:
        """Open the clutch if the one who closed it is not among ``clients``."""
        if self._client is not None and self._client not in clients:
            self.release()
