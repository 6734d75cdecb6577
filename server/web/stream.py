"""The stream: states to the page as they come, heartbeats and presses from it.

A slow client gets the newest state and never a backlog: a state is made when it can be sent, not
before, and a client that tells with its heartbeats which tick it has shown is waited for.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from typing import Annotated, Any, Literal

import msgspec
from fastapi import APIRouter, Query, WebSocket
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from starlette.websockets import WebSocketDisconnect, WebSocketState

from robot.errors import KeyholeError
from server.web.access_guard import caller_of
from server.web.api_models import Body, Flag, LeaderPose
from server.web.api_motion import pass_on
from server.web.api_robot import robot_path
from server.web.events import Asked
from server.web.operator_watch import Presence
from server.web.problems import problem_of
from server.web.refusals import NotTheOperator, UnreadableRequest
from server.web.services import Services, services_of

LARGEST_MESSAGE = 4096
UNSHOWN_S = 1.0
"""A client that tells what it has shown gets nothing new while it is this far behind."""

WARNED_S = 600.0
"""So long before its session ends a page is told."""

_PROBLEMS_KEPT = 8


Deflection = Annotated[float, Field(strict=True, ge=-1, le=1, allow_inf_nan=False)]


class Heartbeat(Body):
    """The page lives; ``tick`` is the newest it has shown."""

    type: Literal["heartbeat"]
    tick: Annotated[int, Field(strict=True, ge=0)] | None = None


class Hold(Body):
    """Hold-to-move was pressed or released."""

    type: Literal["hold"]
    down: Flag


class Renew(Body):
    """The operator goes on driving."""

    type: Literal["renew"]


class LetGo(Body):
    """The operator's mouse button came up over the scene: no gizmo is dragged."""

    type: Literal["let-go"]


class EmergencyStop(Body):
    """Stop all motion; taken whatever else stands in the message."""

    model_config = ConfigDict(extra="ignore")

    type: Literal["emergency-stop"]


class PageError(Body):
    """A part of the page failed, which is told in its place."""

    type: Literal["page-error"]
    words: Annotated[str, Field(max_length=300)]


class LeaderMessage(LeaderPose):
    """One sample of a leader, as POST leader takes it."""

    type: Literal["leader"]


class GamepadMessage(Body):
    """What a gamepad says: rates right, up, toward the operator, and turns about those axes."""

    type: Literal["gamepad"]
    axes: tuple[Deflection, Deflection, Deflection, Deflection, Deflection, Deflection]
    buttons: Annotated[int, Field(strict=True, ge=0, le=3)]


Incoming = (
    Heartbeat | Hold | Renew | LetGo | EmergencyStop | PageError | LeaderMessage | GamepadMessage
)
_incoming: TypeAdapter[Incoming] = TypeAdapter(Annotated[Incoming, Field(discriminator="type")])
router = APIRouter()


def read_message(text: str) -> Incoming:
    """One message of a client.

    Raises:
        UnreadableRequest: it is none of those that the stream takes.
    """
    if len(text) > LARGEST_MESSAGE:
        raise UnreadableRequest(f"the message is longer than {LARGEST_MESSAGE} characters")
    try:
        return _incoming.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "message"
        raise UnreadableRequest(f"{place}: {first['msg']}") from None


class Progress:
    """Which of the states that were sent the client has shown."""

    def __init__(self) -> None:
        self._unshown: deque[tuple[int, float]] = deque()
        self._tells = False

    def sent(self, tick: int, now: float) -> None:
        """A state was sent."""
        if self._unshown and tick < self._unshown[-1][0]:
            # Control was started anew, or a replay went back: older numbers are never confirmed.
            self._unshown.clear()
        if self._tells:
            self._unshown.append((tick, now))

    def shown(self, tick: int | None) -> None:
        """The client has shown the state of ``tick``."""
        if tick is None:
            return
        self._tells = True
        while self._unshown and self._unshown[0][0] <= tick:
            self._unshown.popleft()

    def is_behind(self, now: float) -> bool:
        """Whether a state has waited for too long to be shown."""
        return bool(self._unshown) and now - self._unshown[0][1] > UNSHOWN_S


class StreamClient:
    """One open stream.

    Args:
        websocket: accepted.
        services: of the application.
        period_s: between two states.
    """

    def __init__(self, websocket: WebSocket, services: Services, period_s: float) -> None:
        self._websocket, self._services, self._period_s = websocket, services, period_s
        self._caller = caller_of(websocket.scope)
        self._progress = Progress()
        self._problems: deque[Any] = deque(maxlen=_PROBLEMS_KEPT)
        self._told, staying = services.events.notices.staying()
        self._problems.extend(msgspec.json.encode(one.message()).decode() for one in staying)
        self._warned = False

    async def run(self) -> None:
        """Serve until the client goes."""
        presence = self._services.watch.opened(self._caller)
        try:
            sender = asyncio.create_task(self._send())
            receiver = asyncio.create_task(self._receive(presence))
            done, pending = await asyncio.wait(
                (sender, receiver), return_when=asyncio.FIRST_COMPLETED
            )
        finally:
            self._services.watch.closed(presence)
        for task in pending:
            task.cancel()
        for task in (*done, *pending):
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await task

    async def _send(self) -> None:
        deadline = time.monotonic()
        while not self._is_over():
            now = time.monotonic()
            self._take_notices()
            if not self._progress.is_behind(now):
                text = self._services.source.text(self._caller)
                self._progress.sent(self._services.source.newest_tick, now)
                await self._websocket.send_text(text)
            while self._problems:
                await self._websocket.send_text(self._problems.popleft())
            deadline += self._period_s
            if deadline < time.monotonic():
                # What was missed is not made up for: it would be the same state twice.
                deadline = time.monotonic() + self._period_s
            await asyncio.sleep(deadline - time.monotonic())

    def _is_over(self) -> bool:
        """Whether the session behind this stream has ended; warns some minutes before."""
        left_s = self._services.access.left_s(self._caller)
        if left_s < WARNED_S and not self._warned:
            self._warned = True
            words = (
                f"This browser's session ends in {max(0.0, left_s) / 60.0:.0f} min: open the "
                "address that keyhole printed once more to stay."
            )
            notice = {"type": "notice", "kind": "trouble", "text": words}
            self._problems.append(msgspec.json.encode(notice).decode())
        return left_s <= 0.0

    def _take_notices(self) -> None:
        you = self._services.lease.is_held_by(self._caller)
        self._told, new = self._services.events.notices.since(self._told, you)
        self._problems.extend(msgspec.json.encode(one.message()).decode() for one in new)

    async def _receive(self, presence: Presence) -> None:
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            try:
                self._take(read_message(message.get("text") or ""), presence)
            except KeyholeError as refusal:
                self._note(refusal)
                document = {"type": "problem", "problem": problem_of(refusal)}
                self._problems.append(msgspec.json.encode(document).decode())

    def _note(self, refusal: KeyholeError) -> None:
        if isinstance(refusal, NotTheOperator):
            address = self._websocket.client.host if self._websocket.client else "unknown"
            path = robot_path(services_of(self._websocket).configuration.robot)
            asked = Asked("POST", f"{path}/leader", address, self._caller)
            self._services.events.refused(asked, refusal)

    def _take(self, message: Incoming, presence: Presence) -> None:
        services = self._services
        match message:
            case EmergencyStop():
                services.link.emergency_stop()
                by = services.events.who(self._caller, "its page")
                words = f"{by}: press the emergency stop (stream)"
                services.events.note("emergency_stop", words, by=by)
            case Heartbeat():
                services.watch.heartbeat(presence)
                self._progress.shown(message.tick)
            case Hold():
                services.watch.hold(presence, message.down)
            case Renew():
                services.lease.renew(self._caller)
            case LetGo():
                services.lease.check(self._caller)
                services.scenes.let_go()
            case PageError():
                services.events.page_failed(self._caller, message.words)
            case GamepadMessage():
                services.lease.check(self._caller)
                services.gamepad.sample(message.axes, message.buttons)
            case LeaderMessage():
                services.lease.check(self._caller)
                pass_on(message, services)


@router.websocket("/stream")
async def stream(
    websocket: WebSocket,
    rate_hz: Annotated[float, Query(ge=0.1, le=120, allow_inf_nan=False)] = 30.0,
) -> None:
    """States as JSON text, ``rate_hz`` times a second; see :class:`StreamClient`."""
    await websocket.accept()
    client = StreamClient(websocket, services_of(websocket), 1.0 / rate_hz)
    try:
        await client.run()
    finally:
        if websocket.client_state == WebSocketState.CONNECTED:
            with contextlib.suppress(RuntimeError):
                await websocket.close()
