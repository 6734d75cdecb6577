"""Breaking the simulated robot on purpose, to see and to show what the console does about it."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from hardware.faulty_plant import FAULTS
from robot.errors import UnknownName
from server.web.api_models import FaultEntry, FaultInjection
from server.web.api_robot import ROBOT, STATE
from server.web.refusals import NotReady
from server.web.services import Operator, Services, ServicesHere

router = APIRouter(prefix=ROBOT, tags=["faults"])


@router.get("/faults", summary="The faults that can be injected into a simulated robot")
async def faults() -> list[FaultEntry]:
    """What it does about them stands in docs/faults.md."""
    return [FaultEntry(name=name, title=fault.title) for name, fault in FAULTS.items()]


@router.post("/fault", summary="Break the simulated robot", responses=STATE)
async def inject(body: FaultInjection, services: ServicesHere, caller: Operator) -> Response:
    """The one that was injected before is over. 409 where the robot is real."""
    _check_simulated(services)
    if body.fault not in FAULTS:
        raise UnknownName("fault", body.fault, tuple(FAULTS))
    await services.requests.inject_fault(body.fault)
    return services.state(caller)


@router.delete("/fault", summary="Mend the simulated robot", responses=STATE)
async def mend(services: ServicesHere, caller: Operator) -> Response:
    """Nothing moves by that: enable, or reset first. 409 where the robot is real."""
    _check_simulated(services)
    await services.requests.inject_fault("")
    return services.state(caller)


def _check_simulated(services: Services) -> None:
    if services.configuration.hardware.connected:
        raise NotReady(None, "the robot is real: it is not broken on purpose")
