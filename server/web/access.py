"""Who may speak to the server: the token, the session cookie, the Origin and the Host.

A session cookie is a random identity and the time of its admission, signed with the token, so that
the server keeps no list of sessions and a restarted web process still knows the pages that are
open. Times are those of the monotonic clock: setting the wall clock lengthens or ends no session.
The token itself, which programs send with every request, is valid until the console ends.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import math
import secrets
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from server.web.refusals import (
    ForeignHost,
    ForeignOrigin,
    NotAdmitted,
    SessionExpired,
    WrongToken,
)

COOKIE = "keyhole_session"
LEASE_HEADER = "x-keyhole-lease"
_LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
_WILDCARDS = ("", "0.0.0.0", "::", "[::]", "*")
_LONGEST_HEADER = 512
_MOST_RENEWED = 1000


@dataclass(frozen=True)
class Caller:
    """Whom a request comes from.

    Attributes:
        session: identity of the browser session, None for a caller with a bearer token.
        lease_id: the lease it says it acts under, if any.
        ends: when its session ends, s on the monotonic clock.
    """

    session: str | None
    lease_id: str | None
    ends: float = math.inf


def names_of(host: str) -> tuple[str, ...]:
    """Names under which a server bound to ``host`` answers.

    A server on every interface also answers to this machine's own name, and to bare addresses:
    DNS rebinding needs a name, so an address in the Host header is not an attack.
    """
    if host in _WILDCARDS:
        own = socket.gethostname().lower()
        return (*_LOOPBACK, own, f"{own}.local")
    bracketed = f"[{host}]" if ":" in host and not host.startswith("[") else host.lower()
    if bracketed in _LOOPBACK:
        return _LOOPBACK
    return (bracketed, *_LOOPBACK)


def _split(netloc: str, default_port: int) -> tuple[str, int] | None:
    """Host name (IPv6 in brackets) and port of ``netloc``; None if it is not one."""
    try:
        parts = urlsplit(f"//{netloc}")
        port = parts.port if parts.port is not None else default_port
        name = parts.hostname
    except ValueError:
        return None
    if not name or parts.path or parts.query or "@" in netloc:
        return None
    return (f"[{name}]" if ":" in name else name), port


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True


class Access:
    """Decides whether a request may be answered, and for whom.

    Args:
        token: the console's secret.
        host: address the server is bound to.
        session_hours: how long a browser stays let in.
        clock: monotonic clock in seconds.
    """

    def __init__(
        self,
        token: str,
        host: str,
        session_hours: float = 12.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._token = token.encode()
        self._hours, self._clock = session_hours, clock
        self._renewed: dict[str, float] = {}
        self._names = names_of(host)
        self._any_address = host in _WILDCARDS

    @property
    def hours(self) -> float:
        """How long a session lasts."""
        return self._hours

    def token_is(self, offered: str | None) -> bool:
        """Whether ``offered`` is the token, compared in constant time."""
        if offered is None or len(offered) > _LONGEST_HEADER:
            return False
        return hmac.compare_digest(offered.encode(), self._token)

    def new_cookie(self, before: str | None = None) -> str:
        """Value of a cookie that lasts its full time from now on.

        Args:
            before: the browser's present cookie: who renews a session in time stays who they are.
        """
        identity = self.session_of(before) or secrets.token_urlsafe(18)
        now = self._clock()
        if len(self._renewed) >= _MOST_RENEWED:
            del self._renewed[next(iter(self._renewed))]
        self._renewed[identity] = now + self._hours * 3600.0
        proven = f"{identity}.{int(now)}"
        return f"{proven}.{self._signature(proven)}"

    def _proven(self, cookie: str | None) -> tuple[str, float] | None:
        """Identity that a cookie's value proves, and when its session ends or ended."""
        if not cookie or len(cookie) > _LONGEST_HEADER:
            return None
        proven, _, signature = cookie.rpartition(".")
        if not hmac.compare_digest(signature.encode(), self._signature(proven).encode()):
            return None
        identity, _, admitted = proven.partition(".")
        return identity, int(admitted) + self._hours * 3600.0

    def session_of(self, cookie: str | None) -> str | None:
        """Identity that a cookie's value proves, or None, also where its session has ended."""
        found = self._proven(cookie)
        return found[0] if found is not None and self._clock() < found[1] else None

    def left_s(self, caller: Caller) -> float:
        """Seconds until the caller's session ends; negative when it has ended."""
        renewed = self._renewed.get(caller.session or "", -math.inf)
        return max(caller.ends, renewed) - self._clock()

    def _signature(self, identity: str) -> str:
        return hmac.new(self._token, identity.encode(), hashlib.sha256).hexdigest()

    def check_host(self, host: str, default_port: int = 80) -> tuple[str, int]:
        """Name and port from a Host header.

        Raises:
            ForeignHost: the header is missing, unreadable, or names another host.
        """
        found = _split(host, default_port) if len(host) <= _LONGEST_HEADER else None
        if found is None or not self._is_own(found[0]):
            raise ForeignHost(host[:_LONGEST_HEADER], self._names)
        return found

    def _is_own(self, name: str) -> bool:
        return name.lower() in self._names or (self._any_address and _is_address(name))

    def check_origin(self, origin: str | None, port: int) -> None:
        """Refuse a request of a foreign page; a request without an Origin is no page's.

        Args:
            origin: the Origin header, or None.
            port: port from the Host header: the server's own as the caller sees it.

        Raises:
            ForeignOrigin: the page came from another host or port.
        """
        if origin is None:
            return
        scheme, separator, netloc = origin.partition("://")
        found = None
        if separator and scheme in ("http", "https"):
            found = _split(netloc, 443 if scheme == "https" else 80)
        if found is None or not self._is_own(found[0]) or found[1] != port:
            raise ForeignOrigin(origin[:_LONGEST_HEADER])

    def caller(self, headers: Mapping[str, str], cookies: Mapping[str, str]) -> Caller:
        """Whom the request comes from.

        Raises:
            NotAdmitted: neither token nor session.
            WrongToken: another token, and no session.
            SessionExpired: a session that has ended.
        """
        lease_id = headers.get(LEASE_HEADER)
        scheme, _, credentials = headers.get("authorization", "").partition(" ")
        offers = scheme.lower() == "bearer" and credentials.strip() != ""
        session = self._proven(cookies.get(COOKIE))
        if offers and self.token_is(credentials.strip()):
            return Caller(self.session_of(cookies.get(COOKIE)), lease_id)
        if session is None:
            raise WrongToken if offers else NotAdmitted
        if self._clock() >= session[1]:
            raise SessionExpired(self._hours)
        return Caller(session[0], lease_id, session[1])
