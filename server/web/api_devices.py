"""The devices: their state, homing, torque, reboot."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from robot.records import Safety
from server.web.api_robot import ROBOT, STATE
from server.web.device_schema import DevicesPart
from server.web.devices_view import devices_view
from server.web.services import AnyCaller, Operator, ServicesHere

router = APIRouter(prefix=ROBOT, tags=["devices"])

_STILL = (Safety.DISABLED, Safety.PAUSED, Safety.FAULT)


@router.get("/devices", summary="Servo bus and arm")
async def devices(services: ServicesHere, _: AnyCaller) -> DevicesPart:
    """What has a wire: state, rates, loads, temperatures, voltages, errors in words."""
    connected = services.configuration.hardware.connected
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
