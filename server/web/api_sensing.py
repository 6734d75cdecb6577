"""Sensing of the instrument's shape and force: what is sensed, and the switch."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from server.web.api_models import SensingChange
from server.web.api_robot import STATE
from server.web.services import AnyCaller, Operator, ServicesHere
from server.web.state_schema import SensingPart

router = APIRouter(tags=["sensing"])

_SENSED: dict[int | str, dict[str, Any]] = {200: {"model": SensingPart, "description": "Sensed."}}


@router.get("/sensing", summary="Shape and force as sensed now", responses=_SENSED)
async def sensing(services: ServicesHere, caller: AnyCaller) -> dict[str, Any]:
    """The part ``sensing`` of the state. While it is not valid, ``reason`` and ``action`` say why
    and what to do.
    """
    found: dict[str, Any] = services.source.message(caller)["sensing"]
    return found


@router.put("/sensing", summary="Switch sensing on or off", responses=STATE)
async def switch(body: SensingChange, services: ServicesHere, caller: Operator) -> Response:
    """Takes effect with the next tick. Nothing moves by it.

    It can be on where nothing can be sensed; the state then says why.
    """

    def change(settings: Any) -> None:
        settings["sensing"] = body.enabled

    await services.requests.settings(change)
    return services.state(caller)
