"""viser behind our own port: its client at ``/viser/``, its WebSocket at ``/viser``.

The client is one static file of the viser package. The WebSocket is passed through message by
message: all that viser says, and of what the browser says what :mod:`server.web.viser_messages`
lets pass.
"""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import importlib.util
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fastapi import APIRouter, Request, WebSocket
from starlette.responses import Response
from starlette.websockets import WebSocketDisconnect, WebSocketState
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Subprotocol

from server.web.access_guard import caller_of
from server.web.acts import DRAG
from server.web.events import Asked
from server.web.refusals import NotTheOperator
from server.web.services import Services, services_of
from server.web.viser_guard import SECRET_HEADER
from server.web.viser_messages import ViserFilter

LARGEST_UPSTREAM = 50 * 1024 * 1024
_PROTOCOL_PREFIX = "viser-v"
_TRY_AGAIN = 1013
_GOING_AWAY = 1001
_LEASE_WATCH_S = 0.1
_GONE = (ConnectionClosed, WebSocketDisconnect, RuntimeError)


@dataclass(frozen=True)
class ViserAddress:
    """Where viser listens, and the secret that it wants to see."""

    port: int
    secret: str


@cache
def _client_page() -> tuple[bytes, str]:
    """The viser client, compressed, and a tag of its contents.

    Found without importing viser, which takes its time.
    """
    found = importlib.util.find_spec("viser")
    if found is None or found.origin is None:
        raise FileNotFoundError("viser is not installed")
    page = (Path(found.origin).parent / "client" / "build" / "index.html").read_bytes()
    packed = gzip.compress(page, 6, mtime=0)
    return packed, f'"{len(page):x}-{zlib.crc32(page):x}"'


async def _client(request: Request) -> Response:
    packed, tag = await asyncio.to_thread(_client_page)
    headers = {"ETag": tag, "Vary": "Accept-Encoding"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    if "gzip" in request.headers.get("accept-encoding", ""):
        headers["Content-Encoding"] = "gzip"
        return Response(packed, media_type="text/html", headers=headers)
    page = await asyncio.to_thread(gzip.decompress, packed)
    return Response(page, media_type="text/html", headers=headers)


async def _down(upstream: ClientConnection, websocket: WebSocket) -> None:
    """Everything from viser goes to the browser; a slow browser slows down only its own."""
    async for frame in upstream:
        if isinstance(frame, bytes):
            await websocket.send_bytes(frame)


class _Upward:
    """From the browser to viser: only what the filter lets pass."""

    def __init__(
        self,
        upstream: ClientConnection,
        websocket: WebSocket,
        services: Services,
        asked: asyncio.Event,
    ) -> None:
        self._upstream, self._websocket = upstream, websocket
        self._services, self._lease = services, services.lease
        self._caller = caller_of(websocket.scope)
        self._filter = ViserFilter()
        self._asked = asked

    async def pass_on(self) -> None:
        """Pass messages on until the browser goes."""
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            frame = message.get("bytes")
            if frame and self._filter.passes(frame, self._lease.is_held_by(self._caller)):
                await self._upstream.send(frame)
            if self._filter.refused_drags:
                self._note_drag()

    def _note_drag(self) -> None:
        self._filter.refused_drags = 0
        address = self._websocket.client.host if self._websocket.client else "unknown"
        holder = self._lease.holder
        refusal = NotTheOperator(holder.operator if holder else None)
        self._services.events.refused(Asked("POST", DRAG, address, self._caller), refusal)

    async def end_lost_drags(self) -> None:
        """Let go what the browser drags when its page asks for it, or it loses the lease; end with
        its session.
        """
        while self._services.access.left_s(self._caller) > 0.0:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._asked.wait(), _LEASE_WATCH_S)
            if self._asked.is_set() or not self._lease.is_held_by(self._caller):
                self._asked.clear()
                for frame in self._filter.ends_of_drags():
                    await self._upstream.send(frame)


async def _pass_through(
    upstream: ClientConnection, websocket: WebSocket, services: Services
) -> None:
    with services.scenes.one() as asked:
        upward = _Upward(upstream, websocket, services, asked)
        tasks = [
            asyncio.create_task(_down(upstream, websocket)),
            asyncio.create_task(upward.pass_on()),
            asyncio.create_task(upward.end_lost_drags()),
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            for task in tasks:
                with contextlib.suppress(asyncio.CancelledError, *_GONE):
                    await task


def viser_router(address: Callable[[], ViserAddress | None]) -> APIRouter:
    """The routes of the proxy.

    Args:
        address: where viser is; None while it is not there yet.
    """
    router = APIRouter(include_in_schema=False)
    router.add_api_route("/viser/", _client, methods=["GET", "HEAD"])

    @router.websocket("/viser")
    async def passed_through(websocket: WebSocket) -> None:
        offered = [p for p in websocket.scope["subprotocols"] if p.startswith(_PROTOCOL_PREFIX)]
        where = address()
        if where is None or not offered:
            await websocket.close(_TRY_AGAIN)
            return
        try:
            upstream = await connect(
                f"ws://127.0.0.1:{where.port}",
                subprotocols=[Subprotocol(offered[0])],
                additional_headers={SECRET_HEADER: where.secret},
                compression=None,
                max_size=LARGEST_UPSTREAM,
                ping_interval=None,
                proxy=None,
            )
        except (OSError, InvalidHandshake):
            await websocket.close(_TRY_AGAIN)
            return
        async with upstream:
            await websocket.accept(subprotocol=upstream.subprotocol)
            await _pass_through(upstream, websocket, services_of(websocket))
        if websocket.client_state == WebSocketState.CONNECTED:
            with contextlib.suppress(RuntimeError):
                await websocket.close(_GOING_AWAY)

    return router
