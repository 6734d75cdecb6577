"""Who drives: take, renew, hand over and release the lease."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from server.web.api_models import HandOver, LeaseGrant, LeaseRequest
from server.web.api_robot import ROBOT
from server.web.lease import Holder
from server.web.services import AnyCaller, Operator, Services, ServicesHere

router = APIRouter(prefix=f"{ROBOT}/lease", tags=["operator"])


def _grant(services: Services, holder: Holder) -> LeaseGrant:
    services.source.forget_texts()
    ends = services.lease.expires_in_s or 0.0
    return LeaseGrant(
        lease_id=holder.lease_id, operator=holder.operator, expires_in_s=round(ends, 3)
    )


@router.post("", summary="Take control")
async def take(body: LeaseRequest, services: ServicesHere, caller: AnyCaller) -> LeaseGrant:
    """One operator drives, everybody may watch. 409 while another holds the lease.

    Renew it before it expires, or the robot pauses.
    """
    holder, before = services.lease.take(body.operator, caller)
    if before is not None:
        services.watch.operator_lost(f"{before.operator} handed over to {holder.operator}")
    return _grant(services, holder)


@router.post("/renew", summary="Go on driving")
async def renew(services: ServicesHere, caller: AnyCaller) -> LeaseGrant:
    """The lease lasts its full time from now on."""
    return _grant(services, services.lease.renew(caller))


@router.post("/hand-over", summary="Offer control to another operator")
async def hand_over(body: HandOver, services: ServicesHere, caller: AnyCaller) -> LeaseGrant:
    """The next who takes control under that name gets it; the robot pauses at that moment."""
    services.lease.offer(body.to, caller)
    return _grant(services, services.lease.check(caller))


@router.delete("", status_code=204, summary="Stop driving")
async def release(services: ServicesHere, caller: Operator) -> Response:
    """An enabled robot pauses."""
    holder = services.lease.release(caller)
    services.watch.operator_lost(f"{holder.operator} released control")
    return Response(status_code=204)
