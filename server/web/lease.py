"""One operator: a lease that is taken, renewed, handed over, released, and that expires."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass

from server.web.access import Caller
from server.web.refusals import LeaseHeld, NotTheOperator


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

    @property
    def holder(self) -> Holder | None:
        """Who holds it now; an expired lease has no holder, even before :meth:`expire` ran."""
        return self._holder if self._holder and self._clock() < self._ends else None

    @property
    def offered_to(self) -> str | None:
        """Name to whom the holder has offered it."""
        return self._offered_to if self.holder else None

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
            raise LeaseHeld(before.operator, self._offered_to, self._ends - self._clock())
        if before is not None and self.is_held_by(caller):
            self._holder = Holder(operator, before.lease_id, before.session)
            if operator == self._offered_to:
                self._offered_to = None
            before = None
        else:
            self._holder = Holder(operator, secrets.token_urlsafe(18), caller.session)
            self._offered_to = None
        self._ends = self._clock() + self._seconds
        return self._holder, before

    def _may_follow(self, before: Holder, operator: str, caller: Caller) -> bool:
        return self.is_held_by(caller) or self._offered_to == operator

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
        self._offered_to = to

    def release(self, caller: Caller) -> Holder:
        """Give it back.

        Raises:
            NotTheOperator: ``caller`` does not hold it.
        """
        holder = self.check(caller)
        self._holder, self._offered_to = None, None
        return holder

    def expire(self) -> Holder | None:
        """Drop an expired lease; returns who held it, once."""
        holder = self._holder
        if holder is None or self.holder is not None:
            return None
        self._holder, self._offered_to = None, None
        return holder
