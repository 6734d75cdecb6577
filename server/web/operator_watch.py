"""Watches over the operator: a lost lease, a closed stream, missing heartbeats pause the robot."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable

from robot.records import Request, Safety
from server.memory.link import WebLink
from server.web.access import Caller
from server.web.api_leaders import REPEAT_S, PoseLeader, TargetLeader
from server.web.events import WebEvents
from server.web.lease import Lease
from server.web.state_source import StateSource

HEARTBEAT_S = 2.0
"""Longest silence of an operator's page that sends heartbeats."""

HOLD_S = 0.6
"""A press of hold-to-move counts no longer than this unless it is repeated."""

_log = logging.getLogger("keyhole.web")


class Presence:
    """One open stream, and when it last gave a sign of life."""

    def __init__(self, caller: Caller) -> None:
        self.caller = caller
        self.heartbeat_at: float | None = None
        self.held_at: float | None = None


class OperatorWatch:
    """Knows the open streams and acts when the operator is gone. Belongs to the event loop.

    Args:
        link: to the control process.
        source: of the newest record.
        lease: who drives.
        target: is let go when the operator is lost.
        pose: is let go when the operator is lost.
        events: where it is noted that the operator was lost.
        clock: monotonic clock in seconds.
    """

    def __init__(
        self,
        link: WebLink,
        source: StateSource,
        lease: Lease,
        target: TargetLeader,
        pose: PoseLeader,
        events: WebEvents,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._link, self._source, self._lease = link, source, lease
        self._target, self._pose, self._clock = target, pose, clock
        self._events = events
        self._streams: set[Presence] = set()

    def opened(self, caller: Caller) -> Presence:
        """Know a new stream."""
        presence = Presence(caller)
        self._streams.add(presence)
        words = f"a page was opened, {len(self._streams)} in all"
        self._events.note("stream_opened", words, session=(caller.session or "")[:6])
        return presence

    def closed(self, presence: Presence) -> None:
        """A stream has ended: if it was the operator's and no other of theirs lives, pause."""
        self._streams.discard(presence)
        words = f"a page was closed, {len(self._streams)} left"
        session = (presence.caller.session or "")[:6]
        self._events.note("stream_closed", words, session=session)
        if presence.held_at is not None:
            self._link.hold(False)
        if self._lease.is_held_by(presence.caller) and not self._is_present():
            self.operator_lost("the operator's stream was closed")

    def heartbeat(self, presence: Presence) -> None:
        """The page of a stream lives."""
        presence.heartbeat_at = self._clock()

    def hold(self, presence: Presence, down: bool) -> None:
        """Hold-to-move was pressed, is still pressed, or was released.

        Raises:
            NotTheOperator: the stream is not the operator's.
        """
        self._lease.check(presence.caller)
        presence.held_at = self._clock() if down else None
        self._link.hold(down)

    def operator_lost(self, why: str) -> None:
        """Nobody drives any more: let every leader go and ask control to pause."""
        _log.info("pausing: %s", why)
        self._events.note("operator_lost", f"nobody drives: {why}")
        self._link.request(Request.OPERATOR_LOST)
        self._link.hold(False)
        for presence in self._streams:
            presence.held_at = None
        self._target.clear()
        self._pose.open()
        self._link.stop_path()
        self._source.forget_texts()

    def _is_present(self) -> bool:
        now = self._clock()
        return any(
            presence.heartbeat_at is not None and now - presence.heartbeat_at <= HEARTBEAT_S
            for presence in self._operators()
        )

    def _operators(self) -> list[Presence]:
        return [one for one in self._streams if self._lease.is_held_by(one.caller)]

    def check(self) -> None:
        """Look whether the operator is still there, and repeat what must be repeated."""
        self._link.alive()
        expired = self._lease.expire()
        enabled = self._source.safety() == Safety.ENABLED
        beating = [one for one in self._operators() if one.heartbeat_at is not None]
        self._events.tick()
        if expired is not None:
            words = f"the lease of {expired.operator} expired: it was not renewed"
            self._events.note("lease_expired", words, by=expired.operator)
            self.operator_lost(f"the lease of {expired.operator} expired")
        elif enabled and self._lease.holder is None:
            self.operator_lost("nobody holds the lease")
        elif enabled and beating and not self._is_present():
            self.operator_lost("the operator's page went silent")
        self._repeat_hold()
        self._target.repeat()

    def _repeat_hold(self) -> None:
        now = self._clock()
        for presence in self._streams:
            if presence.held_at is None:
                continue
            stale = now - presence.held_at > HOLD_S
            if stale or not self._lease.is_held_by(presence.caller):
                presence.held_at = None
                self._link.hold(False)
            else:
                self._link.hold(True)

    async def run(self) -> None:
        """Check for ever."""
        self.operator_lost("the web process has just started")
        while True:
            try:
                self.check()
            except Exception:
                # Without these checks nobody would notice a lost operator, so they go on.
                _log.exception("a check of the operator failed")
            await asyncio.sleep(REPEAT_S)
