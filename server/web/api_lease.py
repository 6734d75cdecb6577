"""Who drives: take, renew, hand over and release the lease."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from robot.records import Request, Safety
from server.web.api_models import HandOver, LeaseGrant, LeaseRequest
from server.web.lease import Holder
from server.web.services import AnyCaller, Operator, Services, ServicesHere

router = APIRouter(prefix="/lease", tags=["operator"])


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
    had = services.lease.is_held_by(caller)
    holder, before = services.lease.take(body.operator, caller)
    if before is not None:
        words = f"{before.operator} handed over to {holder.operator}"
        services.events.note("lease_handed_over", words, by=before.operator, to=holder.operator)
        services.watch.operator_lost(words)
    elif not had:
        words = f"{holder.operator} took control"
        services.events.note("lease_taken", words, by=holder.operator)
    return _grant(services, holder)


@router.post("/renew", summary="Go on driving")
async def renew(services: ServicesHere, caller: AnyCaller) -> LeaseGrant:
    """The lease lasts its full time from now on."""
    return _grant(services, services.lease.renew(caller))


@router.post("/hand-over", summary="Offer control to another operator")
async def hand_over(body: HandOver, services: ServicesHere, caller: Operator) -> LeaseGrant:
    """The next who takes control under that name gets it. Until then nothing moves.

    An enabled robot pauses now, and cannot be enabled before the offer is taken or withdrawn. An
    answer to a request for control is for whoever asked, and for nobody else of that name.
    """
    services.lease.offer(body.to, caller)
    if services.source.safety() == Safety.ENABLED:
        await services.requests.ask(Request.PAUSE)
    holder = services.lease.check(caller)
    words = f"{holder.operator} offered control to {body.to}"
    services.events.note("lease_offered", words, by=holder.operator, to=body.to)
    return _grant(services, holder)


@router.delete("/hand-over", summary="Withdraw the offer")
async def withdraw_offer(services: ServicesHere, caller: Operator) -> LeaseGrant:
    """Whoever offered control keeps it; the robot stays paused."""
    to, holder = services.lease.withdraw_offer(caller), services.lease.check(caller)
    if to is not None:
        words = f"{holder.operator} withdrew the offer of control to {to}"
        services.events.note("lease_offer_withdrawn", words, by=holder.operator, to=to)
    return _grant(services, holder)


@router.post("/request", status_code=204, summary="Ask the operator for control")
async def ask_for_control(
    body: LeaseRequest, services: ServicesHere, caller: AnyCaller
) -> Response:
    """The operator sees who asks, and offers control or declines. Forgotten after a minute."""
    known = services.lease.wish
    wish = services.lease.ask(body.operator, caller)
    if known is None:
        words = f"{wish.operator} asks for control"
        services.events.note("lease_asked_for", words, by=wish.operator)
    services.source.forget_texts()
    return Response(status_code=204)


@router.delete("/request", status_code=204, summary="Decline, or ask no longer")
async def end_request(services: ServicesHere, caller: AnyCaller) -> Response:
    """The operator declines; whoever asked from a browser may withdraw."""
    wish = services.lease.end_wish(caller)
    if wish is not None:
        declined = services.lease.is_held_by(caller)
        end = "declined" if declined else "withdrawn"
        words = f"the request for control by {wish.operator} was {end}"
        services.events.note("lease_request_ended", words, by=wish.operator, declined=declined)
    services.source.forget_texts()
    return Response(status_code=204)


@router.delete("", status_code=204, summary="Stop driving")
async def release(services: ServicesHere, caller: Operator) -> Response:
    """An enabled robot pauses."""
    holder = services.lease.release(caller)
    services.events.note(
        "lease_released", f"{holder.operator} released control", by=holder.operator
    )
    services.watch.operator_lost(f"{holder.operator} released control")
    return Response(status_code=204)
