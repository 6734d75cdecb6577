"""Requests to the safety state. Stopping is open to everyone, moving only to the operator."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from robot.records import Request
from server.web.api_robot import STATE
from server.web.refusals import HandingOver
from server.web.services import AnyCaller, Operator, ServicesHere

router = APIRouter(tags=["safety"], responses=STATE)


@router.post("/emergency-stop", summary="Stop all motion now")
async def emergency_stop(services: ServicesHere, caller: AnyCaller) -> Response:
    """Anyone may. The robot holds its position in FAULT until it is reset."""
    await services.requests.emergency_stop()
    return services.state(caller)


@router.post("/pause", summary="Stop and stay ready")
async def pause(services: ServicesHere, caller: AnyCaller) -> Response:
    """Anyone may. 409 with the reason where the transition table does not allow it."""
    await services.requests.ask(Request.PAUSE)
    return services.state(caller)


@router.post("/enable", summary="Let the leader move the tip")
async def enable(services: ServicesHere, caller: Operator) -> Response:
    """409 with the reason where the transition table does not allow it, the devices are not
    ready, the shaft does not go through the trocar, or control is being handed over.
    """
    offered_to = services.lease.offered_to
    if offered_to is not None:
        raise HandingOver(offered_to)
    await services.requests.ask(Request.ENABLE)
    return services.state(caller)


@router.post("/disable", summary="End driving")
async def disable(services: ServicesHere, caller: Operator) -> Response:
    """409 with the reason where the transition table does not allow it."""
    await services.requests.ask(Request.DISABLE)
    return services.state(caller)


@router.post("/reset", summary="Leave FAULT for DISABLED")
async def reset(services: ServicesHere, caller: Operator) -> Response:
    """Never leads to motion. 409 with the reason where there is no fault."""
    await services.requests.ask(Request.RESET)
    return services.state(caller)
