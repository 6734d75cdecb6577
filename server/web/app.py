"""The web application: the API, the stream, the page, and viser, behind one door."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from fastapi import FastAPI

from robot.configuration import Configuration
from server.audit.writer import AuditLog
from server.memory.link import WebLink
from server.version import version
from server.web import (
    api_audit,
    api_boards,
    api_devices,
    api_lease,
    api_method,
    api_motion,
    api_paths,
    api_priority,
    api_recording,
    api_replay,
    api_robot,
    api_safety,
    api_sensing,
    api_stylus,
    api_tendons,
    api_trocar,
    other_robots,
    problems,
    stream,
)
from server.web.access import Access
from server.web.access_guard import AccessGuard
from server.web.page_files import add_page, describe
from server.web.services import make_services
from server.web.viser_proxy import ViserAddress, viser_router

_OWN_PARTS = {
    "instrument": (api_priority, api_tendons, api_trocar, api_boards, api_sensing),
    "concentric": (api_method,),
}


def _include_robot(app: FastAPI, robot: str) -> None:
    """Everything below the path of the robot of that name."""
    prefix = api_robot.robot_path(robot)
    shared = (api_lease, api_safety, api_motion, api_paths, api_devices, api_recording)
    routers = [api_robot.robot_router, *(part.router for part in shared + _OWN_PARTS[robot])]
    for router in routers:
        app.include_router(router, prefix=prefix, dependencies=[api_replay.RobotOnly])
    for part in (api_audit, api_replay, api_stylus, stream):
        app.include_router(part.router, prefix=prefix)


def create_app(
    configuration: Configuration,
    link: WebLink,
    access: Access,
    viser_address: Callable[[], ViserAddress | None] = lambda: None,
    scene: Callable[[], str] = lambda: "loading",
    audit: AuditLog | None = None,
) -> FastAPI:
    """Make the application of one console.

    Args:
        configuration: of the robot.
        link: to the control process.
        access: who may speak.
        viser_address: where viser listens; None while it is not there yet.
        scene: ``loading``, ``ready``, or why there is no scene.
        audit: where requests and refusals are noted; None keeps nothing.
    """
    services = make_services(configuration, link, access, audit or AuditLog("web", None), scene)

    @contextlib.asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if services.replay is not None:
            # There is no robot that an operator could be lost for.
            yield
            return
        watching = asyncio.create_task(services.watch.run())
        try:
            yield
        finally:
            watching.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await watching
            services.watch.operator_lost("the web process ends")

    app = FastAPI(
        title="Keyhole",
        version=version(),
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
    )
    app.state.services = services
    app.add_middleware(AccessGuard, access=access, events=services.events)
    problems.install(app)
    app.include_router(api_robot.router)
    _include_robot(app, configuration.robot)
    app.include_router(other_robots.router(configuration.robot))
    app.include_router(viser_router(viser_address))
    add_page(app)
    describe(app)
    return app
