"""Requests to the control process, each waited for until control has taken it in."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.records import LeaderKind, Request, Safety
from robot.safety import REASONS, Event, check_request, successor
from server.memory.link import WebLink
from server.web.refusals import ControlSilent, NotReady
from server.web.state_source import StateSource

ANSWER_S = 1.0
"""How long control may take to answer before the caller is told that it does not."""

_POLL_S = 0.001


def safety_of(record: NDArray[Any]) -> Safety:
    """The safety state in a (1,) RECORD."""
    return Safety(int(record["outcome"]["state"]["safety"][0]))


class ControlRequests:
    """Asks control, and tells whether it did as it was asked. Belongs to the event loop.

    Args:
        link: to the control process.
        source: of the newest record.
    """

    def __init__(self, link: WebLink, source: StateSource) -> None:
        self._link, self._source = link, source
        self._settings_lock = asyncio.Lock()

    async def ask(self, request: Request) -> None:
        """Ask for a change of the safety state.

        Raises:
            RequestRefused: the transition table does not allow it.
            NotReady: control took it in and did not follow it.
            ControlSilent: control does not answer.
        """
        before = safety_of(self._source.fresh_record())
        check_request(before, request)
        record = await self._taken_in(self._link.request(request))
        wanted, after = successor(before, Event(request)), safety_of(record)
        if after != wanted:
            reason = REASONS[Event(int(record["outcome"]["state"]["reason"][0]))]
            raise NotReady(after.name, f"the robot is in {after.name}: {': '.join(reason)}")

    async def emergency_stop(self) -> None:
        """Stop all motion; nothing is checked or waited for before it is sent.

        Raises:
            ControlSilent: sent, but control does not confirm it.
        """
        number = self._link.emergency_stop()
        self._source.forget_texts()
        await self._taken_in(number)

    async def settings(self, change: Callable[[Any], None]) -> None:
        """Change the operator's choices.

        Args:
            change: sets fields of a SETTINGS record; what it leaves alone stays as it is.

        Raises:
            ControlSilent: control does not answer.
        """
        async with self._settings_lock:
            settings = self._source.fresh_record()["input"]["settings"].copy()
            change(settings[0])
            await self._taken_in(self._link.settings(settings))

    async def start_path(self, samples: NDArray[np.float64], name: str) -> None:
        """Play a path.

        Args:
            samples: (n, 8), time in s, translation in m, unit quaternion.
            name: shown while it plays.

        Raises:
            NotReady: the robot is not enabled, or something else leads it.
            ControlSilent: control does not answer.
        """
        record = self._source.fresh_record()
        check_enabled(record)
        state = record["outcome"]["state"][0]
        if record["header"]["path_id"][0] != 0:
            raise NotReady(safety_of(record).name, "a path is playing; stop it first")
        if state["engaged"] and state["leader_kind"] != LeaderKind.API_TARGET:
            leader = LeaderKind(int(state["leader_kind"])).name.lower()
            raise NotReady(safety_of(record).name, f"the {leader} leads the tip; let it go first")
        number = await asyncio.to_thread(self._link.start_path, samples, name)
        record = await self._taken_in(number)
        if record["header"]["path_id"][0] == 0:
            raise NotReady(safety_of(record).name, "control did not start the path; see its log")

    async def stop_path(self) -> None:
        """Stop the path that plays, if any.

        Raises:
            ControlSilent: control does not answer.
        """
        self._source.fresh_record()
        await self._taken_in(self._link.stop_path())

    async def _taken_in(self, number: int) -> NDArray[Any]:
        """The first record seen after control had taken in request ``number``."""
        ends = time.monotonic() + ANSWER_S
        while time.monotonic() < ends:
            record = self._source.record()
            if record is not None and record["header"]["request_sequence"][0] >= number:
                self._source.forget_texts()
                return record
            await asyncio.sleep(_POLL_S)
        raise ControlSilent(f"control did not answer within {ANSWER_S:g} s", ANSWER_S)


def check_enabled(record: NDArray[Any]) -> None:
    """Raise :class:`NotReady` unless the (1,) ``record`` says that the robot is enabled."""
    safety = safety_of(record)
    if safety == Safety.ENABLED:
        return
    reset = "reset, then " if safety == Safety.FAULT else ""
    raise NotReady(safety.name, f"the robot is in {safety.name}: {reset}enable it first")
