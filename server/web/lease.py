"""One operator: a lease that is taken, renewed, handed over, released, and that expires."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from server.web.access import Caller
from server.web.refusals import AlreadyAsked, LeaseHeld, NobodyToAsk, NotTheOperator


@dataclass(frozen=True)
class Holder:
    """Who holds the lease.

    Attributes:
        operator: the name they gave.
        lease_id: secret that proves the lease to the API.
        session: browser session that took it, None for a caller with a bearer token.
    """

    operator: str
    lease_id: str
    session: str | None


class Wish(NamedTuple):
    """Somebody asks for control.

    Attributes:
        operator: the name they gave.
        session: their browser session, None for a program.
        ends: when the wish is forgotten, s on the lease's clock.
    """

    operator: str
    session: str | None
    ends: float


WISH_S = 60.0
"""How long a request for control stands without being repeated."""


class Lease:
    """The lease of one robot. Not thread safe: it belongs to the event loop.

    Args:
        seconds: how long it lasts without being renewed.
        clock: monotonic clock in seconds.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._seconds, self._clock = seconds, clock
        self._holder: Holder | None = None
        self._ends = 0.0
        self._offered_to: str | None = None
        self._offered_session: str | None = None
        self._wish: Wish | None = None

    @property
    def holder(self) -> Holder | None:
        """Who holds it now; an expired lease has no holder, even before :meth:`expire` ran."""
        return self._holder if self._holder and self._clock() < self._ends else None

    @property
    def offered_to(self) -> str | None:
        """Name to whom the holder has offered it."""
        return self._offered_to if self.holder else None

    @property
    def wish(self) -> Wish | None:
        """Who asks the holder for control."""
        wish = self._wish
        return wish if wish and self.holder and self._clock() < wish.ends else None

    @property
    def expires_in_s(self) -> float | None:
        """Seconds until it ends unless it is renewed, None when nobody holds it."""
        return self._ends - self._clock() if self.holder else None

    def is_held_by(self, caller: Caller) -> bool:
        """Whether ``caller`` is the holder, by lease identity or by browser session."""
        holder = self.holder
        if holder is None:
            return False
        if caller.lease_id is not None and secrets.compare_digest(
            caller.lease_id.encode(), holder.lease_id.encode()
        ):
            return True
        return caller.session is not None and caller.session == holder.session

    def check(self, caller: Caller) -> Holder:
        """The holder, if that is ``caller``.

        Raises:
            NotTheOperator: it is not.
        """
        holder = self.holder
        if holder is None or not self.is_held_by(caller):
            raise NotTheOperator(holder.operator if holder else None)
        return holder

    def take(self, operator: str, caller: Caller) -> tuple[Holder, Holder | None]:
        """Make ``caller`` the holder.

        Returns:
            The new holder, and the one from whom it was taken over, if any.

        Raises:
            LeaseHeld: somebody else holds it and has not offered it to this name.
        """
        before = self.holder
        if before is not None and not self._may_follow(before, operator, caller):
            left_s = self._ends - self._clock()
            raise LeaseHeld(before.operator, self._offered_to, left_s, operator)
        if before is not None and self.is_held_by(caller):
            self._holder = Holder(operator, before.lease_id, before.session)
            if operator == self._offered_to:
                self._offered_to = None
            before = None
        else:
            self._holder = Holder(operator, secrets.token_urlsafe(18), caller.session)
            self._offered_to = self._wish = None
        self._ends = self._clock() + self._seconds
        return self._holder, before

    def _may_follow(self, before: Holder, operator: str, caller: Caller) -> bool:
        if self.is_held_by(caller):
            return True
        # Who asked and was answered is known; nobody else takes it by calling themselves so.
        known = self._offered_session
        return self._offered_to == operator and (known is None or known == caller.session)

    def ask(self, operator: str, caller: Caller) -> Wish:
        """Ask the holder for control; repeated, it stands for its full time again.

        Raises:
            NobodyToAsk: nobody else holds it.
            AlreadyAsked: somebody else asks already.
        """
        if self.holder is None or self.is_held_by(caller):
            raise NobodyToAsk
        standing = self.wish
        if standing is not None and (standing.operator, standing.session) != (
            operator,
            caller.session,
        ):
            raise AlreadyAsked(standing.operator)
        self._wish = Wish(operator, caller.session, self._clock() + WISH_S)
        return self._wish

    def end_wish(self, caller: Caller) -> Wish | None:
        """Withdraw one's own request for control, or decline another's; returns it.

        Raises:
            NotTheOperator: it is another's, and ``caller`` does not hold the lease.
        """
        wish = self.wish
        if wish is not None and (caller.session is None or wish.session != caller.session):
            self.check(caller)
        self._wish = None
        return wish

    def renew(self, caller: Caller) -> Holder:
        """Let the lease last its full time from now on.

        Raises:
            NotTheOperator: ``caller`` does not hold it.
        """
        holder = self.check(caller)
        self._ends = self._clock() + self._seconds
        return holder

    def offer(self, to: str, caller: Caller) -> None:
        """Let the next who takes it under the name ``to`` have it, and nobody else.

        Raises:
            NotTheOperator: ``caller`` does not hold it.
        """
        self.renew(caller)
        wish = self.wish
        self._offered_to = to
        self._offered_session = wish.session if wish is not None and wish.operator == to else None

    def withdraw_offer(self, caller: Caller) -> str | None:
        """Keep it after all; returns to whom it was offered.

        Raises:
            NotTheOperator: ``caller`` does not hold it.
        """
        self.renew(caller)
        to, self._offered_to = self._offered_to, None
        return to

    def release(self, caller: Caller) -> Holder:
        """Give it back.

        Raises:
            NotTheOperator: ``caller`` does not hold it.
        """
        holder = self.check(caller)
        self._holder = self._offered_to = self._wish = None
        return holder

    def expire(self) -> Holder | None:
        """Drop an expired lease; returns who held it, once."""
        holder = self._holder
        if holder is None or self.holder is not None:
            return None
        self._holder = self._offered_to = self._wish = None
        return holder
