"""The operator page, and the documentation of the API without anything from another server."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path

from fastapi import APIRouter, FastAPI
from fastapi.openapi.utils import get_openapi
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.staticfiles import StaticFiles

_SWAGGER = {"swagger-ui-bundle.js": "text/javascript", "swagger-ui.css": "text/css"}

_DOCUMENTATION = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Keyhole: the API</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="/assets/icon.svg" type="image/svg+xml">
<link rel="stylesheet" href="/docs/swagger-ui.css"></head>
<body><main id="documentation"></main>
<script src="/docs/swagger-ui-bundle.js"></script>
<script src="/docs/start.js"></script></body></html>
"""

_START = """SwaggerUIBundle({
  url: "/openapi.json", dom_id: "#documentation", deepLinking: true, docExpansion: "list",
  defaultModelsExpandDepth: 0, tryItOutEnabled: true, displayRequestDuration: true,
});
"""

_INTRODUCTION = """Everything the operator page does, a program can do here.

**Who may speak.** Send `Authorization: Bearer TOKEN` with every request; `keyhole` prints the token
at its start. A browser that opened the printed address is let in by its cookie.

**Who may drive.** One operator at a time: `POST lease` gives a `lease_id` to be sent as
`X-Keyhole-Lease`, and to be renewed before it expires. Everybody may read, pause, and press the
emergency stop.

**Units.** Positions in mm, angles in degrees, times in s, unless the name of a field says
otherwise. Orientations are unit quaternions w, x, y, z. Poses are in the robot's base frame.

**The stream.** `WS /api/v1/robots/instrument/stream?rate_hz=30` sends the state message as JSON
text. The client may send

- `{"type":"heartbeat","tick":N}`: the page lives, and has shown the state of tick N (optional)
- `{"type":"hold","down":true}`: hold-to-move, repeated at least twice a second while down
- `{"type":"renew"}`: the operator goes on driving
- `{"type":"leader","position_mm":[0,0,0],"orientation_wxyz":[1,0,0,0],"clutch":true}`
- `{"type":"let-go"}`: the operator's mouse button came up over the scene
- `{"type":"emergency-stop"}`
- `{"type":"page-error","words":"..."}`: a part of the page failed, for the audit log

A message that is refused is answered by `{"type":"problem","problem":{...}}`. When the operator's
stream is closed, or heartbeats stop for 1 s, the robot pauses.

**Refusals** are problem documents (RFC 9457) with a stable word in `code`.
"""


def page_directory() -> Path:
    """Folder of the operator page."""
    return Path(str(resources.files("frontend_assets"))) / "page"


@cache
def _swagger_file(name: str) -> bytes:
    return (resources.files("fastapi_swagger") / "resources" / name).read_bytes()


def _documentation_router() -> APIRouter:
    router = APIRouter(prefix="/docs", include_in_schema=False)

    @router.get("")
    async def documentation() -> HTMLResponse:
        return HTMLResponse(_DOCUMENTATION)

    @router.get("/start.js")
    async def start() -> Response:
        return Response(_START, media_type="text/javascript")

    def add(name: str, media_type: str) -> None:
        @router.get(f"/{name}", name=name)
        def swagger_file() -> Response:
            return Response(_swagger_file(name), media_type=media_type)

    for name, media_type in _SWAGGER.items():
        add(name, media_type)
    return router


def add_page(app: FastAPI) -> None:
    """Serve the operator page at ``/`` and ``/assets/``, the documentation at ``/docs``."""
    page = page_directory()
    app.include_router(_documentation_router())

    @app.get("/", include_in_schema=False)
    async def index() -> FileResponse:
        return FileResponse(page / "index.html", media_type="text/html")

    app.mount("/assets", StaticFiles(directory=page), name="assets")


def describe(app: FastAPI) -> None:
    """Make the OpenAPI document say how to be let in."""

    def openapi() -> dict[str, object]:
        if app.openapi_schema is None:
            document = get_openapi(
                title=app.title, version=app.version, description=_INTRODUCTION, routes=app.routes
            )
            schemes = {
                "token": {"type": "http", "scheme": "bearer"},
                "lease": {"type": "apiKey", "in": "header", "name": "X-Keyhole-Lease"},
                "session": {"type": "apiKey", "in": "cookie", "name": "keyhole_session"},
            }
            document.setdefault("components", {})["securitySchemes"] = schemes
            document["security"] = [{"token": [], "lease": []}, {"session": []}]
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]
