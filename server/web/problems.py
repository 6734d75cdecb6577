"""Problem documents (RFC 9457): what a caller gets instead of an answer."""

from __future__ import annotations

import math
from enum import Enum
from http import HTTPStatus
from pathlib import Path
from typing import Any

import msgspec
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response

from robot.errors import KeyholeError, UnknownName
from robot.safety import RequestRefused
from robot.tension.feasibility import TensionsNotMeasured
from server.web.refusals import WebRefusal

MEDIA_TYPE = "application/problem+json"
_LONGEST_TEXT = 200
_MOST_ERRORS = 20


def status_of(error: KeyholeError) -> int:
    """HTTP status under which a refusal leaves the server."""
    if isinstance(error, WebRefusal):
        return error.status
    if isinstance(error, RequestRefused | TensionsNotMeasured):
        return HTTPStatus.CONFLICT
    if isinstance(error, UnknownName):
        return HTTPStatus.NOT_FOUND
    return HTTPStatus.UNPROCESSABLE_ENTITY


def _plain(value: object) -> Any:
    """``value`` in a form that JSON has; what it has no form for becomes text."""
    match value:
        case Enum() | Path():
            return value.name
        case float() if not math.isfinite(value):
            return str(value)
        case None | bool() | int() | float():
            return value
        case tuple() | list():
            return [_plain(part) for part in value[:_MOST_ERRORS]]
        case dict():
            return "(an object)"
        case _:
            return str(value)[:_LONGEST_TEXT]


def problem(status: int, code: str, detail: str, data: dict[str, Any] | None = None) -> Any:
    """A problem document as a dictionary."""
    title = HTTPStatus(status).phrase
    core = {"type": "about:blank", "title": title, "status": status, "detail": detail, "code": code}
    return {**core, **{k: _plain(v) for k, v in (data or {}).items() if k not in core}}


def problem_of(error: KeyholeError) -> Any:
    """The problem document of a refusal, with its data."""
    data = {name: value for name, value in vars(error).items() if not name.startswith("_")}
    return problem(int(status_of(error)), error.code, str(error), data)


def response(document: Any) -> Response:
    """The HTTP response that carries a problem document."""
    headers = {"WWW-Authenticate": "Bearer"} if document["status"] == 401 else None
    return Response(
        msgspec.json.encode(document), document["status"], headers=headers, media_type=MEDIA_TYPE
    )


def validation_problem(error: RequestValidationError) -> Any:
    """The problem document of a body or parameter that is not what the interface describes."""
    errors = [
        {
            "field": ".".join(str(part) for part in one["loc"] if part != "body") or "body",
            "message": one["msg"],
            "value": _plain(one.get("input")),
        }
        for one in error.errors()[:_MOST_ERRORS]
    ]
    first = errors[0]
    document = problem(422, "invalid_request", f"{first['field']}: {first['message']}")
    return {**document, "errors": errors}


def install(app: FastAPI) -> None:
    """Make every error of ``app`` leave as a problem document."""

    @app.exception_handler(KeyholeError)
    async def _(request: Request, error: KeyholeError) -> Response:
        # For the door, which notes what was refused.
        request.scope.setdefault("state", {})["refusal"] = error
        return response(problem_of(error))

    @app.exception_handler(RequestValidationError)
    async def _(request: Request, error: RequestValidationError) -> Response:
        return response(validation_problem(error))

    @app.exception_handler(HTTPException)
    async def _(request: Request, error: HTTPException) -> Response:
        code = HTTPStatus(error.status_code).name.lower()
        detail = f"{error.detail}: {request.method} {request.url.path[:_LONGEST_TEXT]}"
        answer = response(problem(error.status_code, code, detail))
        answer.headers.update(error.headers or {})
        return answer

    @app.exception_handler(Exception)
    async def _(request: Request, error: Exception) -> Response:
        detail = "the server failed on this request; its log says more"
        return response(problem(500, "internal_error", detail))
