"""What the web process notes in the audit log, and what of it the operator is told."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from robot.errors import KeyholeError
from server.audit.throttle import Throttle
from server.audit.writer import AuditLog
from server.web.access import Caller
from server.web.acts import OFTEN, act_of, route_of
from server.web.lease import Lease
from server.web.notices import Notices
from server.web.refusals import (
    ForeignHost,
    ForeignOrigin,
    LeaseHeld,
    NotAdmitted,
    NotTheOperator,
    SessionExpired,
    WrongToken,
)

ALIKE_S = 5.0
"""Of refusals or requests that are alike, one is noted in so long, with how many came after it."""
TOLD_S = 15.0
"""Likewise for what the operator is told of refusals."""

LONGEST_BODY = 1024
_TOLD = (
    ForeignHost,
    ForeignOrigin,
    LeaseHeld,
    NotAdmitted,
    NotTheOperator,
)


@dataclass(frozen=True)
class Asked:
    """A request as the door saw it.

    Attributes:
        method: of HTTP; GET for a WebSocket.
        path: of the request.
        address: of whoever asks.
        caller: who was admitted; None for nobody.
        body: what was sent, as far as it is kept.
    """

    method: str
    path: str
    address: str
    caller: Caller | None = None
    body: bytes = b""


class WebEvents:
    """Notes and tells. Belongs to the event loop, but for :meth:`scene_failed`.

    Args:
        audit: of this process.
        lease: who drives.
    """

    def __init__(self, audit: AuditLog, lease: Lease) -> None:
        self.audit, self._lease = audit, lease
        self.notices = Notices()
        self._alike, self._told = Throttle(ALIKE_S), Throttle(TOLD_S)

    def note(self, event: str, text: str, **data: object) -> None:
        """Append an entry to the audit log."""
        self.audit.note(event, text, **data)

    def who(self, caller: Caller | None, address: str) -> str:
        """Name for the log: the operator's, or what is known of somebody else."""
        holder = self._lease.holder
        if caller is None:
            return f"somebody at {address}"
        if holder is not None and self._lease.is_held_by(caller):
            return holder.operator
        kind = "a program" if caller.session is None else f"a watcher ({caller.session[:6]})"
        return f"{kind} at {address}"

    def asked(self, asked: Asked, status: int, refusal: KeyholeError | None) -> None:
        """A request was answered: note what would change something, and what was refused."""
        if refusal is not None and isinstance(refusal, _TOLD):
            self.refused(asked, refusal)
            return
        if asked.method in ("GET", "HEAD", "OPTIONS"):
            return
        by, route = self.who(asked.caller, asked.address), route_of(asked.path)
        alike = 0
        if route in OFTEN or status == 429:
            held = self._alike.passes((by, route, status))
            if held is None:
                return
            alike = held
        code = None if refusal is None else refusal.code
        words = f"{by}: {act_of(asked.method, asked.path)}"
        if status >= 400:
            words += f" (refused: {refusal or status})"
        self.note(
            "request", words, method=asked.method, path=asked.path, status=status, by=by,
            address=asked.address, code=code, body=_body(asked.body), alike=alike or None,
        )  # fmt: skip

    def refused(self, asked: Asked, refusal: KeyholeError) -> None:
        """Somebody was turned away: note it, and tell the operator."""
        by = self._refused_who(asked, refusal)
        act = act_of(asked.method, asked.path)
        held = self._alike.passes((refusal.code, by, act))
        if held is None:
            return
        words = f"{by} tried to {act}"
        self.note(
            "refused", f"refused: {words}", code=refusal.code, by=by, detail=str(refusal),
            method=asked.method, path=asked.path, address=asked.address, body=_body(asked.body),
            alike=held or None,
        )  # fmt: skip
        if self._told.passes((refusal.code, by)) is not None:
            self.notices.post("refused", f"Refused: {words}.")

    def _refused_who(self, asked: Asked, refusal: KeyholeError) -> str:
        somebody = f"somebody at {asked.address}"
        match refusal:
            case ForeignOrigin():
                who = f"a page of {refusal.origin[:80] or 'nowhere'}"
            case ForeignHost():
                who = f"a request to the foreign host name {refusal.host[:80] or 'nobody'}"
            case SessionExpired():
                who = f"a browser at {asked.address} whose session has ended"
            case WrongToken():
                who = f"{somebody} with a wrong or expired token"
            case NotAdmitted():
                who = f"{somebody} without a token"
            case LeaseHeld() if refusal.wanted:
                who = f"{refusal.wanted} (at {asked.address})"
            case _:
                who = self.who(asked.caller, asked.address)
        return who

    def scene_failed(self, words: str) -> None:
        """The scene could not be drawn, told by its thread, once."""
        self.audit.note("scene_failed", f"the scene could not be drawn: {words}")
        text = f"The scene cannot be drawn as it should: {words}. The robot is not affected."
        self.notices.post("trouble", text, everyone=True, stays=True)

    def page_failed(self, caller: Caller, words: str) -> None:
        """A part of somebody's page failed, as it says itself."""
        if self._alike.passes(("page", words)) is not None:
            by = self.who(caller, "a page")
            self.note("page_failed", f"a part of the page of {by} failed: {words}", by=by)

    def tick(self) -> None:
        """Tell, once, that the log cannot be written; called some times a second."""
        if self.audit.trouble:
            words = f"The audit log cannot be written: {self.audit.trouble}"
            self.notices.post("trouble", words, everyone=True, stays=True)


def _body(content: bytes) -> Any:
    """A body as it is kept in the log: parsed where it is JSON."""
    if not content:
        return None
    try:
        return json.loads(content)
    except (ValueError, RecursionError):
        return content[:200].decode(errors="replace")
