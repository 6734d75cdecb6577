"""How the tip is led: teleoperation, target and leader poses. For the operator only."""

from __future__ import annotations

from typing import Any

import numpy as np
from fastapi import APIRouter
from starlette.responses import Response

from robot.rotations import matrix_from_quaternion
from server.web.api_models import (
    LeaderAnswer,
    LeaderPose,
    TargetPose,
    TeleoperationChange,
)
from server.web.api_robot import STATE
from server.web.refusals import OutOfRange
from server.web.services import Operator, Services, ServicesHere
from server.web.state_message import ALIGNMENTS

router = APIRouter(tags=["motion"])

_ALIGNMENT_OF = {name: alignment for alignment, name in ALIGNMENTS.items()}
_METRES = 1e-3


@router.put("/teleoperation", summary="Choose how the leader is followed", responses=STATE)
async def teleoperation(
    body: TeleoperationChange, services: ServicesHere, caller: Operator
) -> Response:
    """The tip does not jump when any of this changes while it moves."""
    bounds = services.configuration.teleoperation
    scale, low, high = body.motion_scale, bounds.motion_scale_min, bounds.motion_scale_max
    if scale is not None and not low <= scale <= high:
        raise OutOfRange("motion_scale", scale, low, high)
    turned = np.empty((3, 3))
    if body.view_wxyz is not None:
        matrix_from_quaternion(np.array(body.view_wxyz), turned)

    def change(settings: Any) -> None:
        for name in ("motion_scale", "lock_rotation", "lock_translation", "hold_to_move"):
            value = getattr(body, name)
            if value is not None:
                settings[name] = value
        if body.alignment is not None:
            settings["alignment"] = _ALIGNMENT_OF[body.alignment]
        if body.view_wxyz is not None:
            settings["rotation_base_leader"] = turned

    await services.requests.settings(change)
    return services.state(caller)


@router.post("/target", summary="Send the tip to a pose", responses=STATE)
async def target(body: TargetPose, services: ServicesHere, caller: Operator) -> Response:
    """The tip goes there within its speed limits, as far as limits and priorities allow.

    The target stands until the tip rests, another leader engages, or the operator is gone.
    """
    position = np.array(body.position_mm) * _METRES
    wxyz = None if body.orientation_wxyz is None else np.array(body.orientation_wxyz)
    await services.target.set(position, wxyz)
    return services.state(caller)


@router.post("/leader", summary="One sample of a leader")
async def leader(body: LeaderPose, services: ServicesHere, caller: Operator) -> LeaderAnswer:
    """Send at 50 Hz or more while the clutch is closed: silence pauses the robot.

    The same samples are taken over the stream, as messages of type ``leader``.
    """
    return LeaderAnswer(sequence=pass_on(body, services))


def pass_on(body: LeaderPose, services: Services) -> int:
    """Hand a leader's sample to control; returns its number."""
    position = np.array(body.position_mm) * _METRES
    return services.pose.sample(position, np.array(body.orientation_wxyz), body.clutch)
