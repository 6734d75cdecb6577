"""A WebSocket for one thread that waits in ``select``: no event loop, no thread of its own.

At 500 messages a second each way, most of what an event loop would cost is the loop.
"""

from __future__ import annotations

import select
import socket
import time
from urllib.parse import urlsplit

from websockets.client import ClientProtocol
from websockets.exceptions import InvalidHandshake, InvalidURI
from websockets.frames import Frame, Opcode
from websockets.http11 import Request
from websockets.protocol import State
from websockets.server import ServerProtocol
from websockets.uri import parse_uri

from robot.errors import KeyholeError

LARGEST_FRAME = 1_048_576
_READ_BYTES = 65_536
_LONGEST_ANSWER = 16_384


class ConnectionFailed(KeyholeError):
    """A WebSocket cannot be opened.

    Attributes:
        url: of the other end.
    """

    code = "connection_failed"

    def __init__(self, url: str, detail: str) -> None:
        super().__init__(f"{url}: {detail}")
        self.url = url


class Connection:
    """One open WebSocket, for one thread.

    Args:
        wire: connected; becomes non-blocking.
        protocol: of this end, open.
        first: messages that came with the handshake.

    Attributes:
        closed: why it is closed; empty while it is open.
        heard_ns: when anything last came, the host's monotonic clock.
    """

    def __init__(self, wire: socket.socket, protocol: ClientProtocol | ServerProtocol) -> None:
        self._wire, self._protocol = wire, protocol
        self._unsent = b""
        self._parts: list[bytes] = []
        self.closed = ""
        self.heard_ns = time.monotonic_ns()
        wire.setblocking(False)
        if wire.family in (socket.AF_INET, socket.AF_INET6):
            wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def fileno(self) -> int:
        """For ``select``."""
        return self._wire.fileno()

    @property
    def is_blocked(self) -> bool:
        """Whether the other end has not taken what was sent; nothing more is sent meanwhile."""
        return bool(self._unsent)

    def send(self, text: bytes) -> bool:
        """Send a text message.

        Returns:
            False where it was left out: the other end is slow, or gone. It never gets a backlog.
        """
        if self._unsent:
            self._flush()
        if self._unsent or not self._is_open():
            return False
        self._protocol.send_text(text)
        self._flush()
        return not self.closed

    def ping(self) -> None:
        """Ask the other end for a sign of life."""
        if self._is_open() and not self._unsent:
            self._protocol.send_ping(b"")
            self._flush()

    def receive(self) -> list[bytes]:
        """The messages that have come; never waits."""
        try:
            data = self._wire.recv(_READ_BYTES)
        except BlockingIOError:
            return []
        except OSError as error:
            self._end(error.strerror or "the connection broke")
            return []
        if data:
            self.heard_ns = time.monotonic_ns()
            self._protocol.receive_data(data)
        else:
            self._protocol.receive_eof()
        messages = self.take()
        self._flush()
        if not data:
            self._end("the other end has hung up")
        self._is_open()
        return messages

    def _is_open(self) -> bool:
        if not self.closed and self._protocol.state is not State.OPEN:
            self._end(self._protocol.close_reason or "the other end has closed the connection")
        return not self.closed

    def take(self) -> list[bytes]:
        """The messages that were read together with something else."""
        messages = []
        for event in self._protocol.events_received():
            if isinstance(event, Frame) and event.opcode in (
                Opcode.TEXT,
                Opcode.BINARY,
                Opcode.CONT,
            ):
                self._parts.append(bytes(event.data))
                if event.fin:
                    messages.append(b"".join(self._parts))
                    self._parts.clear()
        return messages

    def _flush(self) -> None:
        self._unsent += b"".join(self._protocol.data_to_send())
        if not self._unsent or self.closed:
            return
        try:
            sent = self._wire.send(self._unsent)
        except BlockingIOError:
            return
        except OSError as error:
            self._end(error.strerror or "the connection broke")
            return
        self._unsent = self._unsent[sent:]

    def _end(self, why: str) -> None:
        self.closed = self.closed or why
        self._unsent = b""

    def close(self) -> None:
        """Close it, without waiting for the other end. Closing twice is harmless."""
        if not self.closed and self._protocol.state is State.OPEN:
            self._protocol.send_close(1001)
            self._flush()
        self._end("closed")
        self._wire.close()


def connect(url: str, timeout_s: float, headers: dict[str, str] | None = None) -> Connection:
    """Open a WebSocket to ``url``; waits no longer than ``timeout_s`` for each step.

    Raises:
        ConnectionFailed: it cannot be opened.
    """
    try:
        uri = parse_uri(url)
    except (InvalidURI, ValueError):
        raise ConnectionFailed(url, "is no address of the form ws://HOST:PORT/PATH") from None
    if uri.secure:
        raise ConnectionFailed(url, "only ws:// is spoken; let a tunnel encrypt it")
    protocol = ClientProtocol(uri, max_size=LARGEST_FRAME)
    request = protocol.connect()
    for name, value in (headers or {}).items():
        request.headers[name] = value
    try:
        wire = socket.create_connection((uri.host, uri.port), timeout_s)
    except OSError as error:
        raise ConnectionFailed(url, error.strerror or str(error)) from None
    try:
        protocol.send_request(request)
        wire.sendall(b"".join(protocol.data_to_send()))
        _shake(wire, protocol, time.monotonic() + timeout_s)
    except (OSError, InvalidHandshake) as error:
        wire.close()
        raise ConnectionFailed(url, " ".join(str(error).split()) or "no answer") from None
    return Connection(wire, protocol)


def _shake(wire: socket.socket, protocol: ClientProtocol, ends: float) -> None:
    """Read the answer to the handshake and nothing behind it."""
    answer = b""
    while not answer.endswith(b"\r\n\r\n") and len(answer) < _LONGEST_ANSWER:
        wire.settimeout(max(0.01, ends - time.monotonic()))
        byte = wire.recv(1)
        if not byte:
            break
        answer += byte
    status = answer.partition(b"\r\n")[0].decode(errors="replace")
    if " 101 " not in status:
        raise ConnectionError(f"does not open a WebSocket: {status or 'no answer'}")
    protocol.receive_data(answer)
    protocol.events_received()
    if protocol.state is not State.OPEN:
        raise protocol.handshake_exc or ConnectionError("does not answer as a WebSocket does")


def accept(listener: socket.socket, timeout_s: float) -> Connection | None:
    """Take a client in that waits at ``listener``; None where it does not speak as it should."""
    try:
        wire, _ = listener.accept()
    except OSError:
        return None
    protocol = ServerProtocol(max_size=LARGEST_FRAME)
    try:
        wire.settimeout(timeout_s)
        while protocol.state is State.CONNECTING:
            data = wire.recv(_READ_BYTES)
            if not data:
                break
            protocol.receive_data(data)
            for event in protocol.events_received():
                if isinstance(event, Request):
                    protocol.send_response(protocol.accept(event))
            wire.sendall(b"".join(protocol.data_to_send()))
    except OSError:
        # It went in the middle of the handshake: there is nobody to tell.
        wire.close()
        return None
    if protocol.state is not State.OPEN:
        wire.close()
        return None
    return Connection(wire, protocol)


def wait(descriptors: list[int], timeout_s: float) -> list[int]:
    """The descriptors that can be read; waits for one with a resolution of microseconds.

    ``poll`` would round the time up to milliseconds, half a sample of a stylus.
    """
    return select.select(descriptors, [], [], max(0.0, timeout_s))[0]


def listen(url: str) -> socket.socket:
    """A socket that listens where ``url`` says.

    Raises:
        ConnectionFailed: it cannot.
    """
    parts = urlsplit(url)
    try:
        host, port = parts.hostname, parts.port
        if parts.scheme != "ws" or host is None or port is None:
            raise ConnectionFailed(url, "is no address of the form ws://HOST:PORT")
        return socket.create_server((host, port))
    except (OSError, ValueError) as error:
        raise ConnectionFailed(url, str(error)) from None
