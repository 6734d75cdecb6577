"""Brings viser and the scene up beside the web server, without keeping anyone waiting."""

from __future__ import annotations

import logging
import os
import secrets
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from robot.configuration import Configuration
from server.memory.link import WebLink
from server.web.viser_guard import guard
from server.web.viser_proxy import ViserAddress

if TYPE_CHECKING:
    from viser import ViserServer

    from server.scene.view import SceneView

_log = logging.getLogger("keyhole.web")


class SceneServer:
    """A viser server on a free loopback port, and the view that draws on it.

    Args:
        configuration: dimensions and where things start.
        link: to the control process.

    Attributes:
        on_failure: called with what failed, once for each kind, from any thread.
    """

    def __init__(self, configuration: Configuration, link: WebLink) -> None:
        self._configuration, self._link = configuration, link
        self._thread: threading.Thread | None = None
        self._state = "loading"
        self._address: ViserAddress | None = None
        self._viser: ViserServer | None = None
        self._view: SceneView | None = None
        self.on_failure: Callable[[str], None] = lambda _: None

    def state(self) -> str:
        """``loading``, ``ready``, or why there is no scene."""
        return self._state

    def address(self) -> ViserAddress | None:
        """Where viser listens; None before the whole scene stands."""
        return self._address

    def start(self, afterwards: Callable[[], None]) -> None:
        """Begin to load; returns at once.

        Args:
            afterwards: called from the loading thread when the scene is up, or has failed.
        """
        self._thread = threading.Thread(
            target=self._bring_up, args=(afterwards,), name="scene-start", daemon=True
        )
        self._thread.start()

    def _bring_up(self, afterwards: Callable[[], None]) -> None:
        try:
            self._load()
        except Exception as error:
            # The console must stay usable without its picture, and say why there is none.
            _log.exception("the scene could not be loaded")
            self._state = f"failed: {type(error).__name__}: {error}"
            self.on_failure(f"{type(error).__name__}: {error}")
        afterwards()

    def _load(self) -> None:
        # It would put viser on a port that others can guess.
        os.environ.pop("_VISER_PORT_OVERRIDE", None)
        import rich
        import viser

        from server.scene.view import SceneView

        rich.reconfigure(quiet=True)
        secret = secrets.token_urlsafe(32)
        self._viser = viser.ViserServer("127.0.0.1", 0, verbose=False)
        guard(self._viser, secret)
        self._view = SceneView(self._viser, self._configuration, self._link)
        self._view.on_failure = self._failed
        self._view.start()
        self._address = ViserAddress(self._viser.get_port(), secret)
        self._state = "ready"

    def _failed(self, words: str) -> None:
        self.on_failure(words)

    def stop(self) -> None:
        """End the view and viser."""
        if self._thread is not None:
            self._thread.join(timeout=5.0)
        self._address = None
        if self._view is not None:
            self._view.stop()
        if self._viser is not None:
            self._viser.stop()
