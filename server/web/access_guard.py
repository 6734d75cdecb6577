"""The door of the server: every request and every WebSocket passes it before anything else runs."""

from __future__ import annotations

from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from typing import Any

from fastapi import HTTPException
from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from robot.errors import KeyholeError
from server.web.access import COOKIE, Access, Caller
from server.web.events import LONGEST_BODY, Asked, WebEvents
from server.web.page_headers import headers_for
from server.web.problems import problem_of, response, status_of
from server.web.refusals import BodyTooLarge, NotAdmitted, SessionExpired, WrongToken

OPEN_PATHS = ("/api/v1/health",)
"""Answered without a token, as a watchdog needs it; tells nothing of the robot."""

LARGEST_BODY = 65_536
LARGEST_PATH_BODY = 24_000_000
"""Bytes; a path of the most rows that are allowed fits into it."""

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="color-scheme" content="light dark">
<meta name="viewport" content="width=device-width"><title>Keyhole: not admitted</title></head>
<body><h1>{title}</h1>
<p>Open the address that <code>keyhole</code> printed when it started: it ends in
<code>/?token=…</code> and lets this browser in {how_long}.</p>
<p>{more}</p></body></html>
"""
_NEW_TOKEN = "A console that was started again has a new token."
_ROBOT_SAFE = "The robot is not affected; whoever drove it with this browser has let it go."


def _welcome(refusal: KeyholeError | None, hours: float) -> str:
    """The page for who is not let in: why, and how to get in."""
    title, more = "This console needs its token", _NEW_TOKEN
    if isinstance(refusal, SessionExpired):
        title, more = "This browser's session has ended", _ROBOT_SAFE
    return _PAGE.format(title=title, how_long=f"for {hours:g} hours", more=more)


def caller_of(scope: Scope) -> Caller:
    """Whom the guard admitted."""
    caller = scope["state"]["caller"]
    assert isinstance(caller, Caller)
    return caller


def _cookies(header: str) -> dict[str, str]:
    try:
        return {name: morsel.value for name, morsel in SimpleCookie(header).items()}
    except CookieError:
        return {}


class AccessGuard:
    """ASGI middleware: Host, Origin, token or session, size of the body, security headers.

    Args:
        app: what lies behind the door.
        access: who may pass.
        events: where requests and refusals are noted.
    """

    def __init__(self, app: ASGIApp, access: Access, events: WebEvents) -> None:
        self._app, self._access, self._events = app, access, events

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Admit or refuse; see the class."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        seen = bytearray()
        try:
            port = self._check_way(scope, headers)
            if scope["type"] == "http" and _offers_token(scope):
                await self._let_in(scope, headers)(scope, receive, send)
                return
            self._admit(scope, headers)
            receive = self._bounded(scope, headers, receive, seen)
        except KeyholeError as refusal:
            self._events.asked(self._asked(scope, seen), status_of(refusal), refusal)
            await self._refuse(refusal, scope, receive, send)
            return
        status = [0]
        try:
            await self._app(scope, receive, self._with_headers(scope, port, headers, send, status))
        finally:
            if scope["type"] == "http":
                why = scope.get("state", {}).get("refusal")
                self._events.asked(self._asked(scope, seen), status[0], why)

    @staticmethod
    def _asked(scope: Scope, body: bytearray) -> Asked:
        address = scope["client"][0] if scope.get("client") else "an unknown address"
        caller = scope.get("state", {}).get("caller")
        return Asked(scope.get("method", "GET"), scope["path"], address, caller, bytes(body))

    def _check_way(self, scope: Scope, headers: Mapping[str, str]) -> int:
        secure = scope["scheme"] in ("https", "wss")
        _, port = self._access.check_host(headers.get("host", ""), 443 if secure else 80)
        self._access.check_origin(headers.get("origin"), port)
        return port

    def _admit(self, scope: Scope, headers: Mapping[str, str]) -> None:
        if scope["path"] in OPEN_PATHS:
            return
        caller = self._access.caller(headers, _cookies(headers.get("cookie", "")))
        scope.setdefault("state", {})["caller"] = caller

    def _let_in(self, scope: Scope, headers: Mapping[str, str]) -> Response:
        """Answer ``/?token=TOKEN``: a cookie, and away with the token from the address bar."""
        asked = self._asked(scope, bytearray())
        if not self._access.token_is(_offered_token(scope)):
            self._events.refused(asked, WrongToken())
            return self._turned_away(None)
        self._events.note("let_in", f"a browser at {asked.address} was let in", by=asked.address)
        answer = RedirectResponse("/", 303, headers=headers_for("/"))
        secure = scope["scheme"] == "https"
        answer.set_cookie(
            COOKIE, self._access.new_cookie(_cookies(headers.get("cookie", "")).get(COOKIE)),
            path="/", httponly=True, samesite="strict", secure=secure,
        )  # fmt: skip
        return answer

    def _turned_away(self, refusal: KeyholeError | None) -> Response:
        return HTMLResponse(_welcome(refusal, self._access.hours), 401, headers=headers_for("/"))

    def _bounded(
        self, scope: Scope, headers: Mapping[str, str], receive: Receive, kept: bytearray
    ) -> Receive:
        """``receive`` that refuses to read more of a body than makes sense; keeps its start."""
        if scope["type"] != "http":
            return receive
        limit = LARGEST_PATH_BODY if scope["path"].endswith("/path") else LARGEST_BODY
        declared = headers.get("content-length", "0")
        if not declared.isdecimal() or int(declared) > limit:
            raise BodyTooLarge(limit)
        seen = 0

        async def bounded() -> Message:
            nonlocal seen
            message = await receive()
            part = message.get("body", b"")
            seen += len(part)
            kept.extend(part[: LONGEST_BODY - len(kept)])
            if seen > limit:
                # The framework turns every other exception into a body that cannot be parsed.
                raise HTTPException(413, str(BodyTooLarge(limit)))
            return message

        return bounded

    async def _refuse(
        self, refusal: KeyholeError, scope: Scope, receive: Receive, send: Send
    ) -> None:
        page = isinstance(refusal, NotAdmitted) and not scope["path"].startswith("/api/")
        if scope["type"] == "websocket":
            await _refuse_websocket(refusal, scope, send)
        elif page:
            await self._turned_away(refusal)(scope, receive, send)
        else:
            await response(problem_of(refusal))(scope, receive, send)

    @staticmethod
    def _with_headers(
        scope: Scope, port: int, headers: Mapping[str, str], send: Send, status: list[int]
    ) -> Send:
        if scope["type"] != "http":
            return send
        extra = headers_for(scope["path"], headers.get("host", ""))
        encoded = [(name.lower().encode(), value.encode()) for name, value in extra.items()]

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                status[0] = message["status"]
                message["headers"] = [*message["headers"], *encoded]
            await send(message)

        return with_headers


def _offers_token(scope: Scope) -> bool:
    return scope["path"] == "/" and b"token=" in scope["query_string"]


def _offered_token(scope: Scope) -> str | None:
    for part in scope["query_string"].split(b"&"):
        name, _, value = part.partition(b"=")
        if name == b"token":
            return str(value.decode(errors="replace"))
    return None


async def _refuse_websocket(refusal: KeyholeError, scope: Scope, send: Send) -> None:
    """Answer the handshake with the problem document where the server can, else just close."""
    if "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": 1008, "reason": refusal.code})
        return
    answer = response(problem_of(refusal))
    start: dict[str, Any] = {
        "type": "websocket.http.response.start",
        "status": answer.status_code,
        "headers": answer.raw_headers,
    }
    await send(start)
    await send({"type": "websocket.http.response.body", "body": answer.body})
