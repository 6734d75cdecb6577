"""What is asked of a robot that this console knows, and does not drive now."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter
from starlette.exceptions import HTTPException

from robot.robots import TITLES
from server.web.api_robot import ROBOTS
from server.web.refusals import RobotNotSelected

_METHODS = ["GET", "POST", "PUT", "DELETE"]


def router(driven: Literal["instrument", "concentric"]) -> APIRouter:
    """Answers for all robots but the one that is driven."""
    made = APIRouter(include_in_schema=False)

    @made.api_route(f"{ROBOTS}/{{robot}}/{{rest:path}}", methods=_METHODS)
    async def elsewhere(robot: str, rest: str) -> None:
        if robot == driven or robot not in TITLES:
            raise HTTPException(404)
        raise RobotNotSelected(robot, driven)

    return made
