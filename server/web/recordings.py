"""Requests to the recorder, each waited for until the recorder has followed it."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

from server.memory.recording_link import RecordingLink, RecordingState, RecordingStatus
from server.web.refusals import AlreadyRecording, RecorderSilent, RecordingFailed

ANSWER_S = 3.0
"""How long the recorder may take to answer: it may have to be started again meanwhile."""

_POLL_S = 0.01


class Recordings:
    """Starts and stops recordings. Belongs to the event loop.

    Args:
        link: to the recorder.
    """

    def __init__(self, link: RecordingLink) -> None:
        self._link = link
        self._lock = asyncio.Lock()

    def status(self) -> RecordingStatus:
        """The present recording, or the last one."""
        return self._link.status()

    async def start(self, path: Path) -> RecordingStatus:
        """Record into ``path`` from now on.

        Raises:
            AlreadyRecording: a recording is being made.
            RecordingFailed: the file cannot be made.
            RecorderSilent: the recorder does not answer.
        """
        async with self._lock:
            before = self.status()
            if before.records:
                raise AlreadyRecording(before.path.name if before.path else "")
            status = await self._answered(self._link.start(path))
        if status.state == RecordingState.FAILED:
            raise RecordingFailed(status.message)
        return status

    async def stop(self) -> RecordingStatus:
        """End the recording; harmless when there is none.

        Raises:
            RecorderSilent: the recorder does not answer.
        """
        async with self._lock:
            if not self.status().records:
                return self.status()
            return await self._answered(self._link.stop())

    async def _answered(self, number: int) -> RecordingStatus:
        ends = time.monotonic() + ANSWER_S
        while time.monotonic() < ends:
            status = self.status()
            if status.answered >= number:
                return status
            await asyncio.sleep(_POLL_S)
        raise RecorderSilent(f"the recorder did not answer within {ANSWER_S:g} s", ANSWER_S)
