"""The one public port, bound by the supervisor before anything else starts."""

from __future__ import annotations

import errno
import ipaddress
import socket

from robot.errors import KeyholeError

_BACKLOG = 128
_WILDCARDS = {"0.0.0.0": "127.0.0.1", "::": "::1"}


class PortUnavailable(KeyholeError):
    """The console cannot listen where it was told to.

    Attributes:
        host: the host asked for.
        port: the port asked for.
    """

    code = "port_unavailable"

    def __init__(self, host: str, port: int, detail: str) -> None:
        super().__init__(detail)
        self.host, self.port = host, port


def listen(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 takes a free one.

    The supervisor keeps it while web processes come and go, so that the port is never lost to
    another program and connections wait for a restarted web process instead of being refused.

    Raises:
        PortUnavailable: the port is taken or not permitted, or the host is not one of ours.
    """
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (socket.gaierror, UnicodeError):
        raise PortUnavailable(host, port, f"the host {host!r} is not known") from None
    family, _, _, _, address = found[0]
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_BACKLOG)
    except (OSError, OverflowError) as error:
        listener.close()
        raise PortUnavailable(host, port, _explain(host, port, error)) from None
    return listener


def _explain(host: str, port: int, error: Exception) -> str:
    number = error.errno if isinstance(error, OSError) else None
    if number == errno.EADDRINUSE:
        return (
            f"port {port} on {host} is taken by another program; end it, "
            "or choose another with --port (0 takes a free one)"
        )
    if number == errno.EACCES:
        return f"port {port} is not permitted to this user; choose one from 1024 on with --port"
    if number == errno.EADDRNOTAVAIL:
        return f"{host} is not an address of this machine; choose another with --host"
    return f"cannot listen on {host} port {port}: {error}"


def address_of(host: str, listener: socket.socket) -> str:
    """The page's address without its token, for a browser on this machine."""
    port = listener.getsockname()[1]
    name = _WILDCARDS.get(host, host or "127.0.0.1")
    return f"http://[{name}]:{port}/" if ":" in name else f"http://{name}:{port}/"


def is_loopback(listener: socket.socket) -> bool:
    """Whether only programs on this machine can reach the listener."""
    address = str(listener.getsockname()[0]).split("%", 1)[0]
    return ipaddress.ip_address(address).is_loopback
