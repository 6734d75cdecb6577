"""Who may speak to the server: the token, the session cookie, the Origin and the Host.

A session cookie is a random identity signed with the token, so that the server keeps no list of
sessions and a restarted web process still knows the pages that are open.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from server.web.refusals import ForeignHost, ForeignOrigin, NotAdmitted

COOKIE = "keyhole_session"
LEASE_HEADER = "x-keyhole-lease"
_LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
_WILDCARDS = ("", "0.0.0.0", "::", "[::]", "*")
_LONGEST_HEADER = 512


@dataclass(frozen=True)
class Caller:
    """Whom a request comes from.

    Attributes:
        session: identity of the browser session, None for a caller with a bearer token.
        lease_id: the lease it says it acts under, if any.
    """

    session: str | None
    lease_id: str | None


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
    """

    def __init__(self, token: str, host: str) -> None:
        self._token = token.encode()
        self._names = names_of(host)
        self._any_address = host in _WILDCARDS

    def token_is(self, offered: str | None) -> bool:
        """Whether ``offered`` is the token, compared in constant time."""
        if offered is None or len(offered) > _LONGEST_HEADER:
            return False
        return hmac.compare_digest(offered.encode(), self._token)

    def new_cookie(self) -> str:
        """Value of a cookie for a fresh session."""
        identity = secrets.token_urlsafe(18)
        return f"{identity}.{self._signature(identity)}"

    def session_of(self, cookie: str | None) -> str | None:
        """Identity that a cookie's value proves, or None."""
        if not cookie or len(cookie) > _LONGEST_HEADER:
            return None
        identity, _, signature = cookie.partition(".")
        if not hmac.compare_digest(signature.encode(), self._signature(identity).encode()):
            return None
        return identity

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
        """
        lease_id = headers.get(LEASE_HEADER)
        scheme, _, credentials = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and self.token_is(credentials.strip()):
            return Caller(self.session_of(cookies.get(COOKIE)), lease_id)
        session = self.session_of(cookies.get(COOKIE))
        if session is None:
            raise NotAdmitted
        return Caller(session, lease_id)
