"""The audit log, read: what happened, by whom, and what was refused."""

from __future__ import annotations

import asyncio
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from server.audit.reader import MOST, newest
from server.web.services import AnyCaller, ServicesHere

router = APIRouter(tags=["console"])


class AuditEntry(BaseModel):
    """One entry; more fields belong to the kinds of events."""

    model_config = ConfigDict(extra="allow")

    time: datetime = Field(description="Wall clock, UTC.")
    event: str = Field(description="A stable word for what happened.")
    text: str = Field(description="The same for people.")
    source: str = Field(description="supervisor, web, recorder or stop.", default="")


@router.get("/audit", summary="What happened", response_model=list[AuditEntry])
async def audit(
    services: ServicesHere,
    _: AnyCaller,
    last: Annotated[int, Query(ge=1, le=MOST, description="At most so many.")] = 100,
    since: Annotated[
        AwareDatetime | None, Query(description="Only later ones; a time with its zone.")
    ] = None,
) -> list[dict[str, Any]]:
    """The newest entries of the audit log, the oldest of them first.

    Starts and ends of processes, who drove when, every request that changes something and every
    refusal, every change of the safety state with its reason.
    """
    where = services.events.audit.where
    return [] if where is None else await asyncio.to_thread(newest, where, last, since)
