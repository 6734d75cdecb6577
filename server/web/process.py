"""The web process: everything that browsers and programs speak to, on the one public port.

The port is bound by the supervisor before this process starts, so nobody is turned away while it
loads or is started again.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import signal
import socket
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import uvicorn
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from robot.errors import KeyholeError
from robot.record_types import record_types_of
from server.audit.writer import AuditLog
from server.control.lifeline import end_with_supervisor
from server.control.realtime import prefer
from server.memory.link import WebLink
from server.memory.run_directory import RunDirectory
from server.scene.server import SceneServer
from server.web.access import Access
from server.web.api_paths import list_experiments
from server.web.app import create_app
from server.web.services import Services

UNSENT_BYTES = 16_384
"""What the kernel may keep of a connection unsent: more would be a backlog of old states."""

_LARGEST_WEBSOCKET_MESSAGE = 262_144
_PATIENCE_S = 2
_TCP_NOTSENT_LOWAT = getattr(socket, "TCP_NOTSENT_LOWAT", 25 if sys.platform == "linux" else None)


def keep_short(listener: socket.socket) -> None:
    """Let connections of ``listener`` keep little that is unsent, where the system can."""
    if _TCP_NOTSENT_LOWAT is not None:
        listener.setsockopt(socket.IPPROTO_TCP, _TCP_NOTSENT_LOWAT, UNSENT_BYTES)


class ShortQueueProtocol(WebSocketsSansIOProtocol):
    """A WebSocket that makes its sender wait instead of keeping much for a slow client."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Bound what may wait in this process."""
        transport.set_write_buffer_limits(high=UNSENT_BYTES)
        super().connection_made(transport)


class WebServer(uvicorn.Server):
    """uvicorn that starts the scene only when it answers."""

    def __init__(
        self, config: uvicorn.Config, scene: SceneServer, afterwards: Callable[[], None]
    ) -> None:
        super().__init__(config)
        self._scene, self._afterwards = scene, afterwards

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen, then load the scene."""
        await super().startup(sockets)
        self._scene.start(self._afterwards)


def load_the_rest(services: Services) -> None:
    """Load what else the first request for it would wait for, and everyone else with it."""
    try:
        list_experiments(services.configuration)
        if services.configuration.robot == "instrument":
            services.dexterity.load()
            services.trocar.load()
        services.source.load()
    except Exception:
        # Whoever asks for it will be told what is wrong with it.
        logging.getLogger("keyhole.web").exception("loading in advance failed")


def serve(directory: RunDirectory, listener: socket.socket) -> None:
    """Serve the console of ``directory`` on ``listener`` until SIGTERM.

    Raises:
        KeyholeError: the run directory holds no console.
    """
    configuration, console = directory.configuration(), directory.console()
    hours = configuration.server.session_hours
    access = Access(directory.token(), str(console["host"]), hours)
    link = WebLink(directory.path, record_types_of(configuration))
    audit = AuditLog.of_console("web", directory.path)
    scene = SceneServer(configuration, link)
    app = create_app(configuration, link, access, scene.address, scene.state, audit)
    scene.on_failure = app.state.services.events.scene_failed
    keep_short(listener)
    config = uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        lifespan="on",
        proxy_headers=False,
        server_header=False,
        ws=ShortQueueProtocol,
        ws_max_size=_LARGEST_WEBSOCKET_MESSAGE,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=_PATIENCE_S,
    )
    try:
        afterwards = partial(load_the_rest, app.state.services)
        WebServer(config, scene, afterwards).run(sockets=[listener])
    finally:
        scene.stop()
        link.close()
        audit.close()


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m server.web.process --run-directory DIR --listen-fd N [--lifeline-fd N]``.

    Returns:
        0 when it was asked to end, 2 when it could not start.
    """
    parser = argparse.ArgumentParser(prog="keyhole web")
    parser.add_argument("--run-directory", required=True, type=Path)
    parser.add_argument("--listen-fd", required=True, type=int)
    parser.add_argument("--lifeline-fd", type=int)
    arguments = parser.parse_args(argv)
    for ignored in (signal.SIGINT, signal.SIGHUP):
        # The supervisor gets them too, and ends everything in order.
        signal.signal(ignored, signal.SIG_IGN)
    logging.basicConfig(format="keyhole web: %(levelname)s %(message)s", level=logging.WARNING)
    prefer()
    end_with_supervisor(arguments.lifeline_fd)
    try:
        serve(RunDirectory(arguments.run_directory), socket.socket(fileno=arguments.listen_fd))
    except KeyholeError as error:
        print(f"keyhole web: {error}", file=sys.stderr, flush=True)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
