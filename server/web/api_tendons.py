"""What the drives of the tendons hold: lengths, or tensions where they are measured."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from robot.tension.feasibility import CONTROL_NAMES, check_tendons
from robot.tension.records import TendonControl
from server.web.api_models import TendonsChange
from server.web.api_robot import STATE
from server.web.services import Operator, ServicesHere

router = APIRouter(tags=["motion"])


@router.put("/tendons", summary="Choose what the tendons' drives hold", responses=STATE)
async def tendons(body: TendonsChange, services: ServicesHere, caller: Operator) -> Response:
    """Takes effect smoothly from the next tick on. What is left out stays as it is."""
    record = services.source.fresh_record()
    tick_input = record["input"][0]
    present = tick_input["settings"]
    control = body.control or TendonControl(int(present["tendon_control"])).name.lower()
    level = body.co_contraction_n
    wanted = float(present["co_contraction"]) if level is None else level
    check_tendons(services.configuration, control, wanted, bool(tick_input["tension_cells"]))

    def change(settings: Any) -> None:
        settings["tendon_control"] = CONTROL_NAMES[control]
        settings["co_contraction"] = wanted

    await services.requests.settings(change)
    return services.state(caller)
