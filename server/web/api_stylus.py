"""Leaders that are devices: what is known of them, and the WebSocket of a stylus without ROS."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any, Literal

import msgspec
from fastapi import APIRouter, WebSocket
from pydantic import BaseModel, Field
from starlette.websockets import WebSocketDisconnect, WebSocketState

from robot.errors import KeyholeError
from robot.records import DriveMode
from server.leaders.led_stylus import NO_FORCE
from server.memory.stylus_records import STYLUS_COUNTS
from server.web.access import Caller
from server.web.access_guard import caller_of
from server.web.problems import problem_of
from server.web.refusals import OnlyAReplay
from server.web.services import Services, ServicesHere, services_of

_IDLE_S = 0.05
_PROBLEMS_PER_S = 4.0
_NO_AGE_NS = 10_000_000_000

router = APIRouter()


class StylusCounts(BaseModel):
    """What came from the stylus since the console or its leader process started."""

    samples: int = Field(description="Good ones.")
    malformed: int
    oversized: int
    wrong_topic: int
    invalid: int = Field(description="Poses that are none: NaN, infinity, a zero quaternion.")
    repeated: int = Field(description="With the stamp of the one before.")
    out_of_order: int
    late: int = Field(description="Later than the time-out behind the quickest.")
    buttons_dead: int = Field(description="How often pressed buttons fell silent.")


class StylusView(BaseModel):
    """What is known of the stylus."""

    source: Literal["rosbridge", "websocket"]
    connected: bool
    url: str
    message: str = Field(description="What is amiss, in words; empty when nothing is.")
    rate_hz: float = Field(description="Good samples a second.")
    age_ms: float | None = Field(description="Of the newest good sample; null without one.")
    delay_ms: float = Field(description="Of the slowest sample of late, above the quickest.")
    buttons: int = Field(description="1 the first, 2 the second, 3 both.")
    buttons_repeat: bool = Field(description="Whether the driver repeats them.")
    clutch: bool
    mode: Literal["both", "arm", "segment"]
    force_n: float
    counts: StylusCounts


class LeadersView(BaseModel):
    """What is known of the leaders that are devices; null where there is no word of one."""

    stylus: StylusView | None


@router.get("/leaders", tags=["reading"], summary="Leaders that are devices")
async def leaders(services: ServicesHere) -> LeadersView:
    """Connection, rate, age and faults of the stylus."""
    status = services.stylus.status()
    if status is None:
        return LeadersView(stylus=None)
    said = status[0]
    age_ns = int(said["stamp_ns"]) - int(said["sample_ns"])
    rosbridge = services.configuration.stylus.source == "rosbridge"
    return LeadersView(
        stylus=StylusView(
            source="rosbridge" if rosbridge else "websocket",
            connected=bool(said["connected"]),
            url=said["url"].decode(errors="replace"),
            message=said["message"].decode(errors="replace"),
            rate_hz=round(float(said["rate_hz"]), 1),
            age_ms=round(age_ns * 1e-6, 1) if said["sample_ns"] else None,
            delay_ms=round(float(said["delay_ns"]) * 1e-6, 1),
            buttons=int(said["buttons"]),
            buttons_repeat=bool(said["buttons_repeat"]),
            clutch=bool(said["clutch"]),
            mode=DriveMode(int(said["mode"])).name.lower(),
            force_n=round(float(said["force_n"]), 3),
            counts=StylusCounts(**{name: int(said["counts"][name]) for name in STYLUS_COUNTS}),
        )
    )


class BridgeClient:
    """One open bridge.

    Args:
        websocket: accepted.
        services: of the application.
    """

    def __init__(self, websocket: WebSocket, services: Services) -> None:
        self._websocket, self._services = websocket, services
        self._caller: Caller = caller_of(websocket.scope)
        self._new = asyncio.Event()
        self._problem: KeyholeError | None = None
        self._problem_due = 0.0

    async def run(self) -> None:
        """Serve until the bridge goes."""
        sender = asyncio.create_task(self._send())
        receiver = asyncio.create_task(self._receive())
        tasks = (sender, receiver)
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._services.stylus.left(self)
            for task in tasks:
                task.cancel()
            for task in tasks:
                with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                    await task

    async def _receive(self) -> None:
        services = self._services
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            data = message.get("bytes") or (message.get("text") or "").encode()
            try:
                services.stylus.check()
                services.lease.check(self._caller)
                sample = services.stylus.take(self, data)
                if sample.renew:
                    services.lease.renew(self._caller)
                self._new.set()
            except KeyholeError as refusal:
                self._problem = refusal

    async def _send(self) -> None:
        """Send each force once, the newest only, zero when nothing comes any more."""
        sent, silent = NO_FORCE, 0
        while self._services.access.left_s(self._caller) > 0.0:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._new.wait(), _IDLE_S)
            self._new.clear()
            force, engaged = self._services.stylus.force(self)
            silent += 1
            # Zero is repeated now and then, so that a bridge can tell that somebody listens.
            if force != NO_FORCE or sent != NO_FORCE or silent >= _EVERY:
                x, y, z = force
                words = f'"force_n":[{x:.5f},{y:.5f},{z:.5f}],"engaged":{_BOOLEAN[engaged]}'
                await self._websocket.send_text(f'{{"type":"force",{words}}}')
                sent, silent = force, 0
            await self._tell_problem()

    async def _tell_problem(self) -> None:
        now = asyncio.get_running_loop().time()
        if self._problem is None or now < self._problem_due:
            return
        refusal, self._problem = self._problem, None
        self._problem_due = now + 1.0 / _PROBLEMS_PER_S
        document: dict[str, Any] = {"type": "problem", "problem": problem_of(refusal)}
        await self._websocket.send_text(msgspec.json.encode(document).decode())


_EVERY = 10
_BOOLEAN = {False: "false", True: "true"}


@router.websocket("/leaders/stylus")
async def stylus(websocket: WebSocket) -> None:
    """Samples in, forces out; see the guide for labs."""
    await websocket.accept()
    services = services_of(websocket)
    if services.replay is not None:
        await websocket.close(1008, OnlyAReplay().code)
        return
    try:
        await BridgeClient(websocket, services).run()
    finally:
        if websocket.client_state == WebSocketState.CONNECTED:
            with contextlib.suppress(RuntimeError):
                await websocket.close()
