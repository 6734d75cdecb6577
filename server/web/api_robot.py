"""The console and its robots: health, which robots there are, and what can be read of the one that
is driven.
"""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from robot.configuration import RobotName
from robot.records import Request, Safety
from robot.robots import TITLES
from robot.safety import REASONS, TRANSITIONS, Event
from server.version import version
from server.web.api_models import Health, RobotEntry, RobotSelected, TransitionEntry
from server.web.refusals import NotReady, OnlyAReplay
from server.web.services import AnyCaller, Operator, ServicesHere
from server.web.state_schema import ConcentricState, StateMessage

ROBOTS = "/api/v1/robots"
STATE: dict[int | str, dict[str, Any]] = {
    200: {"model": StateMessage | ConcentricState, "description": "The state."}
}

router = APIRouter(tags=["console"])
robot_router = APIRouter(tags=["reading"])


def robot_path(robot: str) -> str:
    """Path of everything that belongs to the robot of that name."""
    return f"{ROBOTS}/{robot}"


@router.get("/api/v1/health", summary="Whether the server answers")
async def health(services: ServicesHere) -> Health:
    """Needs no token and tells nothing of the robot."""
    return Health(status="ok", version=version(), scene=services.scene())


@router.get(ROBOTS, summary="The robots of this console")
async def robots(services: ServicesHere) -> list[RobotEntry]:
    """One at a time can be driven; the others can be selected."""
    driven = services.configuration.robot
    return [
        RobotEntry(name=name, title=title, selected=name == driven)
        for name, title in TITLES.items()
    ]


@router.post(f"{ROBOTS}/{{robot}}/select", status_code=202, summary="Drive another robot")
async def select(robot: RobotName, services: ServicesHere, caller: Operator) -> RobotSelected:
    """Ends the control process and starts it with the other robot, DISABLED.

    The web process starts anew with it: connections close, and the lease is gone. 409 unless the
    robot that is driven now is DISABLED. Selecting the one that is driven changes nothing.
    """
    if services.replay is not None:
        raise OnlyAReplay
    if robot != services.configuration.robot:
        safety = services.source.safety()
        # A control process that is down moves nothing, and may be down because of its robot.
        if safety not in (Safety.DISABLED, None):
            raise NotReady(safety.name, f"the robot is in {safety.name}: disable it first")
        services.selection.ask(robot)
    return RobotSelected(robot=robot)


@robot_router.get("/state", summary="The newest state", responses=STATE)
async def state(services: ServicesHere, caller: AnyCaller) -> Response:
    """Positions in mm and orientations as w, x, y, z in the base frame; angles in degrees."""
    return services.state(caller)


@robot_router.get("/configuration", summary="The configuration in force")
async def configuration(services: ServicesHere) -> dict[str, Any]:
    """Every value with its unit in its name, as in the configuration file."""
    return services.configuration.model_dump(mode="json")


@robot_router.get("/transitions", summary="The safety transition table")
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
