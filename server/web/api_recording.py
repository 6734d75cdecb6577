"""Recordings: start, stop, see what is written, list what there is. Open to everyone admitted."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter
from pydantic import BaseModel, Field

from server.memory.recording_link import RecordingState, RecordingStatus
from server.recording import folder
from server.web.api_models import Body
from server.web.services import AnyCaller, ServicesHere

router = APIRouter(tags=["recording"])


class RecordingStart(Body):
    """A recording to begin."""

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        None,
        description="File name in the folder of recordings; left out, it is named by the time.",
        examples=["first-try"],
    )


class RecordingView(BaseModel):
    """The present recording, or the last one of this console."""

    recording: bool = Field(description="Whether records are being written down now.")
    file: str | None = Field(description="Path of the file on the console's machine.")
    size_mb: float = Field(description="10^6 bytes in the file.")
    duration_s: float = Field(description="From the first tick in it to the newest.")
    ticks: int
    gaps: int = Field(description="How often ticks are missing; 0 in a good recording.")
    lost_ticks: int = Field(description="How many are missing.")
    problem: str | None = Field(description="Why it ended by itself, or what is to know of it.")


class RecordingFile(BaseModel):
    """One file in the folder of recordings."""

    name: str
    size_mb: float
    modified: str = Field(description="Date and time of its last write, UTC.")


def _view(status: RecordingStatus) -> RecordingView:
    problem = status.message
    if status.state == RecordingState.RECORDING and not status.alive:
        problem = "the recorder does not answer; it is being started again"
    return RecordingView(
        recording=status.records,
        file=str(status.path) if status.path else None,
        size_mb=round(status.size * 1e-6, 3),
        duration_s=round(status.duration_s, 3),
        ticks=status.ticks,
        gaps=status.gaps,
        lost_ticks=status.lost,
        problem=problem or None,
    )


@router.get("/recording", summary="The present recording")
async def recording(services: ServicesHere) -> RecordingView:
    """File, size, duration and gaps; of the last one while none is being made."""
    return _view(services.recordings.status())


@router.post("/recording", summary="Start recording")
async def start(
    services: ServicesHere, _: AnyCaller, body: RecordingStart | None = None
) -> RecordingView:
    """Every tick goes to a new MCAP file. 409 while a recording is being made."""
    status = await services.recordings.start(folder.named(body.name if body else None))
    services.source.forget_texts()
    return _view(status)


@router.delete("/recording", summary="Stop recording")
async def stop(services: ServicesHere, _: AnyCaller) -> RecordingView:
    """The file is complete when this answers; harmless when no recording is being made."""
    status = await services.recordings.stop()
    services.source.forget_texts()
    return _view(status)


@router.get("/recordings", summary="The recordings there are")
async def recordings(_: AnyCaller) -> list[RecordingFile]:
    """Files in the folder of recordings on the console's machine, the newest first."""
    found = await asyncio.to_thread(folder.entries)
    return [
        RecordingFile(
            name=one.name,
            size_mb=round(one.size * 1e-6, 3),
            modified=datetime.fromtimestamp(one.modified_s, UTC).isoformat(timespec="seconds"),
        )
        for one in found
    ]
