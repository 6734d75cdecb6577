"""The devices: their state, homing, torque, reboot, and faults of a simulated robot on request."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from pydantic import BaseModel, Field
from starlette.responses import Response

from robot.errors import UnknownName
from robot.records import Safety
from server.web.api_models import Body
from server.web.api_robot import STATE
from server.web.device_schema import DevicesPart
from server.web.devices_view import devices_view
from server.web.refusals import NotSimulated
from server.web.services import AnyCaller, Operator, Services, ServicesHere

router = APIRouter(tags=["devices"])

_STILL = (Safety.DISABLED, Safety.PAUSED, Safety.FAULT)


@router.get("/devices", summary="Servo bus and arm")
async def devices(services: ServicesHere, _: AnyCaller) -> DevicesPart:
    """What has a wire: state, rates, loads, temperatures, voltages, errors in words."""
    connected = services.configuration.drives_hardware
    return DevicesPart.model_validate(devices_view(services.link.devices(), connected))


@router.post("/home", summary="Home the instrument", responses=STATE)
async def home(services: ServicesHere, caller: Operator) -> Response:
    """Pulls every tendon slowly until it is taut. Only while DISABLED; readiness tells the end."""
    await services.requests.ask_devices(
        services.link.home, (Safety.DISABLED,), "disable it first; homing moves the servos"
    )
    return services.state(caller)


@router.post("/torque/release", summary="Let go of torque on every device", responses=STATE)
async def release_torque(services: ServicesHere, caller: Operator) -> Response:
    """A bent backbone springs straight. Reaches every servo, also past one that does not answer.

    An enabled or paused robot is disabled by it.
    """
    await services.requests.ask_devices(services.link.release_torque, tuple(Safety), "")
    return services.state(caller)


@router.post("/torque/hold", summary="Put torque on where the devices stand", responses=STATE)
async def take_hold(services: ServicesHere, caller: Operator) -> Response:
    """After a release. Nothing moves; not while ENABLED."""
    await services.requests.ask_devices(services.link.take_hold, _STILL, "pause it first")
    return services.state(caller)


@router.post("/devices/reboot", summary="Start devices anew", responses=STATE)
async def reboot(services: ServicesHere, caller: Operator) -> Response:
    """For servos that took themselves out of service, as after an overload. Home afterwards."""
    await services.requests.ask_devices(services.link.reboot_devices, _STILL, "pause it first")
    return services.state(caller)


class FaultEntry(BaseModel):
    """One fault that a simulated robot can be given."""

    name: str
    title: str
    active: bool = Field(description="Whether it was injected last and not cleared since.")


class FaultInjection(Body):
    """A fault to inject."""

    name: Annotated[str, Field(min_length=1, max_length=80)] = Field(
        description="Name from GET faults.", examples=["servo-silent"]
    )


def _check_simulated(services: Services) -> None:
    if services.configuration.drives_hardware:
        raise NotSimulated


@router.get("/faults", summary="Faults that a simulated robot can be given")
async def faults(services: ServicesHere, _: AnyCaller) -> list[FaultEntry]:
    """Empty for a real robot."""
    from hardware.faulty_plant import plant_faults

    if services.configuration.drives_hardware:
        return []
    active = services.requests.fault
    return [
        FaultEntry(name=name, title=fault.title, active=name == active)
        for name, fault in plant_faults(services.configuration).items()
    ]


@router.post("/faults", summary="Break the simulated robot", responses=STATE)
async def inject(body: FaultInjection, services: ServicesHere, caller: Operator) -> Response:
    """It acts from the next tick on, in the place of the one before. 409 on a real robot."""
    from hardware.faulty_plant import plant_faults

    _check_simulated(services)
    known = plant_faults(services.configuration)
    if body.name not in known:
        raise UnknownName("fault", body.name, tuple(known))
    await services.requests.inject_fault(body.name)
    return services.state(caller)


@router.delete("/faults", summary="Mend the simulated robot", responses=STATE)
async def mend(services: ServicesHere, caller: Operator) -> Response:
    """What the fault led to stays: reset, then enable. 409 on a real robot."""
    _check_simulated(services)
    await services.requests.inject_fault("")
    return services.state(caller)
