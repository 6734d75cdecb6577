"""The board before the instrument: which there are, and which stands there."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter
from starlette.responses import Response

from robot.errors import UnknownName
from server.web.api_models import BoardChange, BoardEntry
from server.web.api_robot import STATE
from server.web.services import Operator, ServicesHere

router = APIRouter(tags=["boards"])


@router.get("/boards", summary="The boards that can be put before the instrument")
async def boards(services: ServicesHere) -> list[BoardEntry]:
    """One of them stands there."""
    from scenes.boards.board import BOARD_NAMES, board

    found = await asyncio.to_thread(
        lambda: [board(name, services.configuration) for name in BOARD_NAMES]
    )
    present = services.link.status()["board"]
    return [
        BoardEntry(name=one.name, title=one.title, present=one.name == present) for one in found
    ]


@router.put("/board", summary="Put another board before the instrument", responses=STATE)
async def change(body: BoardChange, services: ServicesHere, caller: Operator) -> Response:
    """Only while the robot is DISABLED."""
    from scenes.boards.board import BOARD_NAMES

    if body.name not in BOARD_NAMES:
        raise UnknownName("board", body.name, BOARD_NAMES)
    await services.requests.change_board(body.name)
    return services.state(caller)
