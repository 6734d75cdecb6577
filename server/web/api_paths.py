"""Experiments and paths: list, play, stop."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import numpy as np
from fastapi import APIRouter
from starlette.responses import Response

from robot.configuration import Configuration
from robot.rotations import matrix_from_quaternion
from server.web.api_models import ExperimentEntry, PathStart
from server.web.api_robot import STATE
from server.web.refusals import BoardNeeded
from server.web.services import Operator, Services, ServicesHere

if TYPE_CHECKING:
    from scenes.experiments import Experiment
    from scenes.path import Path

router = APIRouter(tags=["paths"])


def list_experiments(configuration: Configuration) -> list[ExperimentEntry]:
    """Every experiment of the robot that is driven, with its length."""
    if configuration.robot == "concentric":
        return _list_tube_paths()
    from scenes import experiments

    found = [experiments.experiment(name, configuration) for name in experiments.names()]
    return [
        ExperimentEntry(
            name=one.name,
            title=one.title,
            duration_s=one.duration_s,
            board=_board_of(one),
            arm_locked=one.lock_arm,
            cases=list(one.cases),
            marks_s=list(one.marks),
        )
        for one in found
    ]


def _list_tube_paths() -> list[ExperimentEntry]:
    from scenes.experiments.tube_playing import TITLES, played

    return [
        ExperimentEntry(
            name=name,
            title=title,
            duration_s=round(played(name).duration_s, 1),
            board=None,
            arm_locked=False,
            cases=[],
            marks_s=[],
        )
        for name, title in TITLES.items()
    ]


def _board_of(experiment: Experiment) -> str | None:
    """Name of the board that must stand there; None where any may."""
    return experiment.board if experiment.board != "none" or experiment.needs_room else None


def _wanted(body: PathStart, configuration: Configuration) -> tuple[Path, str | None, bool]:
    """The path, the board that it needs (None for any), and whether the arm stands still."""
    if body.csv is not None:
        from scenes.path_file import parse_csv

        return parse_csv(body.csv, body.name), None, False
    assert body.experiment is not None
    if configuration.robot == "concentric":
        from scenes.experiments.tube_playing import played

        return played(body.experiment), None, False
    from scenes import experiments

    found = experiments.experiment(body.experiment, configuration)
    return found.path, _board_of(found), found.lock_arm


def _to_the_board(path: Path, services: Services) -> Path:
    """The path with a way from where the tip is to where the board was made for."""
    from scenes.boards.place import place
    from scenes.lead_in import anchored

    report = services.link.snapshot()["outcome"]["report"][0]
    turned = np.empty((3, 3))
    matrix_from_quaternion(report["desired_wxyz"], turned)
    start = place(services.configuration)
    return anchored(path, start.tip, start.tip_rotation, report["desired_position"], turned)[0]


@router.get("/experiments", summary="The experiments that can be played")
async def experiments(services: ServicesHere) -> list[ExperimentEntry]:
    """Each is a path of the tip relative to where it starts."""
    return await asyncio.to_thread(list_experiments, services.configuration)


@router.post("/path", summary="Play a path from where the tip is", responses=STATE)
async def start_path(body: PathStart, services: ServicesHere, caller: Operator) -> Response:
    """While it plays, no other leader is followed.

    An experiment on a board first leads the tip to where the board was made for.

    409 unless the robot is enabled and free, and the experiment's board stands there.
    """
    path, needed, locks_arm = await asyncio.to_thread(_wanted, body, services.configuration)
    services.lease.check(caller)
    present = str(services.link.status()["board"])
    if needed is not None and needed != present:
        raise BoardNeeded(path.name, needed, present)
    if needed not in (None, "none"):
        path = await asyncio.to_thread(_to_the_board, path, services)
    services.target.clear()
    await services.requests.start_path(path.samples, path.name, locks_arm)
    return services.state(caller)


@router.delete("/path", summary="Stop the path", responses=STATE)
async def stop_path(services: ServicesHere, caller: Operator) -> Response:
    """The tip stays where it is; harmless when no path plays."""
    await services.requests.stop_path()
    return services.state(caller)
