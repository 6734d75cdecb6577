"""Makes viser's own port answer nobody but our proxy.

viser binds a port of its own on the loopback interface and asks neither for an Origin nor for a
secret: any page in any browser on this machine could drive the gizmo there. So a connection must
carry a secret that only this process knows; without it, it is closed before viser has told it
anything or listened to it. What viser serves over plain HTTP is its public client and no data.
"""

from __future__ import annotations

import hmac
import logging
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viser import ViserServer
    from viser.infra import WebsockClientConnection

SECRET_HEADER = "X-Keyhole-Proxy"


class NotFromTheProxy(ConnectionError):
    """A connection to viser's own port that did not come through the proxy."""


class _Expected(logging.Filter):
    """Keeps refused connections from filling the log with tracebacks."""

    def filter(self, record: logging.LogRecord) -> bool:
        error = record.exc_info[1] if record.exc_info else None
        return not isinstance(error, NotFromTheProxy)


def guard(viser_server: ViserServer, secret: str) -> None:
    """Refuse every WebSocket at viser's own port that does not carry ``secret``.

    Call it right after the server was made, before anything is drawn. viser offers no place for
    this, so the check is put before its own callbacks for new connections; the version of viser is
    pinned and a test speaks to the port directly.
    """
    server = viser_server._websock_server

    async def check(connection: WebsockClientConnection) -> None:
        identity = connection.client_id
        websocket = server._live_connections[identity]
        request = websocket.request
        offered = "" if request is None else request.headers.get(SECRET_HEADER, "")
        if hmac.compare_digest(offered.encode(), secret.encode()):
            return
        server._live_connections.pop(identity, None)
        server._client_state_from_id.pop(identity, None)
        await websocket.close(1008, "connect through the console")
        raise NotFromTheProxy

    server._client_connect_cb.insert(0, check)
    logging.getLogger("websockets.server").addFilter(_Expected())
