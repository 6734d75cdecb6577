"""What only the concentric-tube arms have: the method that resolves their redundancy."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from robot.concentric.design import METHODS
from server.web.api_models import MethodChange
from server.web.api_robot import STATE
from server.web.services import Operator, ServicesHere

router = APIRouter(tags=["motion"])


@router.put("/method", summary="Choose how the redundancy is resolved", responses=STATE)
async def method(body: MethodChange, services: ServicesHere, caller: Operator) -> Response:
    """Takes effect with the next tick; the arms do not jump."""

    def change(settings: Any) -> None:
        settings["method"] = METHODS.index(body.method)

    await services.requests.settings(change)
    return services.state(caller)
