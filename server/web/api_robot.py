"""What can be read: health, robots, state, configuration, transitions, dexterity."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from robot.records import Case, Request
from robot.safety import REASONS, TRANSITIONS, Event
from server.version import version
from server.web.api_models import Health, RobotEntry, TransitionEntry
from server.web.services import AnyCaller, ServicesHere
from server.web.state_schema import StateMessage

ROBOT = "/api/v1/robots/instrument"
STATE: dict[int | str, dict[str, Any]] = {200: {"model": StateMessage, "description": "The state."}}

router = APIRouter()


@router.get("/api/v1/health", tags=["console"], summary="Whether the server answers")
async def health(services: ServicesHere) -> Health:
    """Needs no token and tells nothing of the robot."""
    return Health(status="ok", version=version(), scene=services.scene())


@router.get("/api/v1/robots", tags=["console"], summary="The robots of this console")
async def robots(services: ServicesHere) -> list[RobotEntry]:
    """One at a time can be driven."""
    arm = services.configuration.arm.name
    return [RobotEntry(name="instrument", title=f"continuum instrument on {arm}")]


@router.get(f"{ROBOT}/state", tags=["reading"], summary="The newest state", responses=STATE)
async def state(services: ServicesHere, caller: AnyCaller) -> Response:
    """Positions in mm and orientations as w, x, y, z in the base frame; angles in degrees."""
    return services.state(caller)


@router.get(f"{ROBOT}/configuration", tags=["reading"], summary="The configuration in force")
async def configuration(services: ServicesHere) -> dict[str, Any]:
    """Every value with its unit in its name, as in the configuration file."""
    return services.configuration.model_dump(mode="json")


@router.get(f"{ROBOT}/transitions", tags=["reading"], summary="The safety transition table")
async def transitions() -> list[TransitionEntry]:
    """What is not listed is refused and changes nothing."""
    requests = {int(request) for request in Request}
    return [
        TransitionEntry(
            state=row.state.name,
            event=row.event.name,
            next=row.next.name,
            request=int(row.event) in requests and row.event != Event.OPERATOR_LOST,
            reason=REASONS[row.event][0],
            action=REASONS[row.event][1],
        )
        for row in TRANSITIONS
    ]


@router.get(f"{ROBOT}/dexterity", tags=["reading"], summary="Dexterity where the tip is now")
async def dexterity(services: ServicesHere) -> dict[str, Any]:
    """The paper's measures (111)-(113) at the commanded configuration.

    Raw, and projected onto what the present priority leaves free.
    """
    record = services.source.fresh_record()
    x = record["outcome"]["report"]["x"][0].copy()
    case = Case(int(record["input"]["settings"]["case"][0]))
    return await asyncio.to_thread(services.dexterity.at, x, case)
