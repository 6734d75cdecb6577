"""A local socket over which tests and people break what is simulated and look at what it did.

One JSON object a line each way; every answer has ``ok`` and ``stamp_ns``, the monotonic time of the
act. ``hardware.fake_servos.client`` is the other end.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from robot.errors import KeyholeError

_LARGEST_LINE = 65_536


class BadRequest(KeyholeError):
    """The control channel was asked for something that it does not know."""

    code = "bad_request"


class BadFault(KeyholeError):
    """A fault was asked for in a way that makes no sense.

    Attributes:
        fault: what was asked for.
    """

    code = "bad_fault"

    def __init__(self, fault: str, detail: str) -> None:
        super().__init__(f"fault {fault!r}: {detail}")
        self.fault = fault


class ControlChannel:
    """Listens, and hands requests to whoever answers them.

    Args:
        path: of the socket; made anew, readable by its owner only.
        answer: makes an answer of a request; may raise :class:`KeyholeError`.
        now_ns: monotonic clock.
    """

    def __init__(
        self,
        path: Path,
        answer: Callable[[dict[str, Any]], dict[str, Any]],
        now_ns: Callable[[], int],
    ) -> None:
        self.path = path
        self._answer = answer
        self._now_ns = now_ns
        self._clients: dict[int, tuple[socket.socket, bytearray]] = {}
        self._listener = socket.socket(socket.AF_UNIX)
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        self._listener.bind(str(path))
        os.chmod(path, 0o600)
        self._listener.listen()
        self._listener.setblocking(False)

    def descriptors(self) -> list[int]:
        """What to wait on."""
        return [self._listener.fileno(), *self._clients]

    def serve(self, descriptor: int) -> None:
        """Do what is to be done at one of :meth:`descriptors`."""
        if descriptor == self._listener.fileno():
            connection, _ = self._listener.accept()
            connection.settimeout(1.0)
            self._clients[connection.fileno()] = (connection, bytearray())
            return
        if descriptor not in self._clients:
            # It was the port's, which has hung up since it was waited on.
            return
        connection, buffer = self._clients[descriptor]
        try:
            data = connection.recv(_LARGEST_LINE)
            buffer += data
            while data and b"\n" in buffer:
                line, _, rest = bytes(buffer).partition(b"\n")
                buffer[:] = rest
                connection.sendall(msgspec.json.encode(self._reply(line)) + b"\n")
        except OSError:
            data = b""
        if not data or len(buffer) > _LARGEST_LINE:
            connection.close()
            del self._clients[descriptor]

    def _reply(self, line: bytes) -> dict[str, Any]:
        stamp_ns = self._now_ns()
        try:
            request = msgspec.json.decode(line)
            if not isinstance(request, dict):
                raise BadRequest("a request is an object")
            answer = self._answer(request)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            return {"ok": False, "stamp_ns": stamp_ns, "code": "bad_json", "message": str(error)}
        except KeyholeError as error:
            return {"ok": False, "stamp_ns": stamp_ns, "code": error.code, "message": str(error)}
        except (TypeError, ValueError, OSError) as error:
            # What a request holds is a stranger's: it must not end the program.
            return {"ok": False, "stamp_ns": stamp_ns, "code": "bad_value", "message": str(error)}
        return {"ok": True, "stamp_ns": stamp_ns} | answer

    def close(self) -> None:
        """End it, and remove the socket."""
        for connection, _ in self._clients.values():
            connection.close()
        self._listener.close()
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()
