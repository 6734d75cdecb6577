"""A recording that is shown in place of a robot: its time, pause and speed."""

from __future__ import annotations

import asyncio
import time
from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field
from starlette.requests import HTTPConnection

from server.memory.replay_link import ReplayLink
from server.recording.replay_process import FASTEST, SLOWEST
from server.web.api_models import Body, Flag, Number
from server.web.refusals import NoReplay, OnlyAReplay, ReplaySilent
from server.web.services import AnyCaller, ServicesHere, services_of
from server.web.state_message import replay_view
from server.web.state_schema import ReplayPart

ANSWER_S = 2.0
_POLL_S = 0.005
_READING = ("GET", "HEAD")

router = APIRouter(tags=["replay"])


class ReplayChange(Body):
    """What to show. What is left out stays as it is."""

    time_s: Number | None = Field(
        None, ge=0, description="Time since the recording's start, s.", examples=[12.5]
    )
    playing: Flag | None = Field(
        None, description="Whether it goes on by itself; at the end, playing begins anew."
    )
    speed: Annotated[Number, Field(ge=SLOWEST, le=FASTEST)] | None = Field(
        None, description="Recorded time over real time."
    )


def nothing_moves(connection: HTTPConnection) -> None:
    """Refuse, where a recording is shown, whatever would go to a robot.

    Raises:
        OnlyAReplay: it is such a request.
    """
    reads = connection.scope.get("method", "GET") in _READING
    if services_of(connection).replay is not None and not reads:
        raise OnlyAReplay


RobotOnly = Depends(nothing_moves)


def _link(services: ServicesHere) -> ReplayLink:
    if services.replay is None:
        raise NoReplay
    return services.replay


def _view(services: ServicesHere) -> ReplayPart:
    status = _link(services).status()
    if status is None:
        raise ReplaySilent("the recording is still being loaded", 0.0)
    return ReplayPart.model_validate(replay_view(status))


@router.get("/replay", summary="What is shown of a recording")
async def replay(services: ServicesHere) -> ReplayPart:
    """404 where this console shows a robot."""
    return _view(services)


@router.put("/replay", summary="Go to a time, play, pause, choose the speed")
async def change(body: ReplayChange, services: ServicesHere, _: AnyCaller) -> ReplayPart:
    """Everyone sees the same. 404 where this console shows a robot."""
    link = _link(services)
    number = link.ask(body.time_s, body.playing, body.speed)
    ends = time.monotonic() + ANSWER_S
    while time.monotonic() < ends:
        status = link.status()
        if status is not None and status.answered >= number:
            services.source.forget_texts()
            return ReplayPart.model_validate(replay_view(status))
        await asyncio.sleep(_POLL_S)
    raise ReplaySilent(f"the replay did not answer within {ANSWER_S:g} s", ANSWER_S)
