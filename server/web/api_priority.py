"""What only the instrument has: priorities, compensation of its tendons, dexterity."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from robot.priority.levels import case_named
from robot.records import Case
from server.web.api_models import CompensationChange, PriorityChange
from server.web.api_robot import STATE
from server.web.instrument_message import COMPENSATIONS, COORDINATES, SOLVERS
from server.web.services import Operator, ServicesHere

router = APIRouter(tags=["motion"])

_SOLVER_OF = {name: solver for solver, name in SOLVERS.items()}
_COORDINATES_OF = {name: coordinates for coordinates, name in COORDINATES.items()}
_COMPENSATION_OF = {name: mode for mode, name in COMPENSATIONS.items()}


@router.put("/priority", summary="Choose what matters most", responses=STATE)
async def priority(body: PriorityChange, services: ServicesHere, caller: Operator) -> Response:
    """Takes effect with the next tick. What is left out stays as it is."""

    def change(settings: Any) -> None:
        if body.case is not None:
            settings["case"] = case_named(body.case)
        if body.solver is not None:
            settings["solver"] = _SOLVER_OF[body.solver]
        if body.coordinates is not None:
            settings["coordinates"] = _COORDINATES_OF[body.coordinates]

    await services.requests.settings(change)
    return services.state(caller)


@router.put("/compensation", summary="Choose how tendons and tracker are met", responses=STATE)
async def compensation(
    body: CompensationChange, services: ServicesHere, caller: Operator
) -> Response:
    """Takes effect smoothly from the next tick on. What is left out stays as it is."""

    def change(settings: Any) -> None:
        if body.mode is not None:
            settings["compensation"] = _COMPENSATION_OF[body.mode]
        if body.tracker is not None:
            settings["use_tracker"] = body.tracker

    await services.requests.settings(change)
    return services.state(caller)


@router.get("/dexterity", summary="Dexterity where the tip is now")
async def dexterity(services: ServicesHere) -> dict[str, Any]:
    """The paper's measures (111)-(113) at the commanded configuration.

    Raw, and projected onto what the present priority leaves free.
    """
    record = services.source.fresh_record()
    x = record["outcome"]["report"]["x"][0].copy()
    case = Case(int(record["input"]["settings"]["case"][0]))
    return await asyncio.to_thread(services.dexterity.at, x, case)
