"""The two ways of a stylus' samples: a rosbridge that we play, and a console that we call."""

from __future__ import annotations

import json
import time
import urllib.request
from collections import deque
from typing import Any
from urllib.error import HTTPError, URLError

from robot.errors import KeyholeError
from server.fake_stylus.program import forces_in
from server.fake_stylus.wording import OwnWording, RosWording
from server.leaders.connection import Connection, ConnectionFailed, accept, connect, listen

STYLUS_PATH = "/api/v1/robots/instrument/leaders/stylus"
_LEASE_PATH = "/api/v1/robots/instrument/lease"

_LOGGED = 20_000
_SHAKE_S, _CALL_S = 1.0, 5.0
_AGAIN_NS, _RENEW_NS = 500_000_000, 1_000_000_000


class RosbridgeServer:
    """A rosbridge with one stylus behind it.

    Args:
        url: where to listen, ``ws://HOST:PORT``.
        wording: topics.

    Raises:
        ConnectionFailed: it cannot listen there.
    """

    def __init__(self, url: str, wording: RosWording) -> None:
        self.wording: RosWording | OwnWording = wording
        self._topics = wording
        self._listener = listen(url)
        self.address = "ws://{}:{}".format(*self._listener.getsockname()[:2])
        self._clients: dict[int, tuple[Connection, set[str]]] = {}
        self._closed_until_ns = 0
        self.forces: deque[tuple[int, float, float, float]] = deque(maxlen=_LOGGED)
        self.servos: deque[tuple[int, list[float]]] = deque(maxlen=_LOGGED)
        self._left_out = 0

    def descriptors(self) -> list[int]:
        """What to wait on."""
        if self._closed_until_ns and time.monotonic_ns() < self._closed_until_ns:
            return list(self._clients)
        return [self._listener.fileno(), *self._clients]

    def serve(self, descriptor: int) -> None:
        """Take a client in, or what one says."""
        if descriptor == self._listener.fileno():
            connection = accept(self._listener, _SHAKE_S)
            if connection is not None:
                self._clients[connection.fileno()] = (connection, set())
                self._take(connection, set(), connection.take())
            return
        connection, topics = self._clients[descriptor]
        self._take(connection, topics, connection.receive())
        if connection.closed:
            del self._clients[descriptor]
            connection.close()

    def _take(self, connection: Connection, topics: set[str], messages: list[bytes]) -> None:
        for text in messages:
            said = forces_in(text) or {}
            operation, topic = said.get("op"), str(said.get("topic", ""))
            if operation == "subscribe":
                topics.add(topic)
            elif operation == "unsubscribe":
                topics.discard(topic)
            elif operation == "publish":
                self._felt(said.get("msg") or {})
            elif operation not in ("advertise", "unadvertise"):
                status = {"op": "status", "level": "error", "msg": f"unknown op {operation!r}"}
                connection.send(json.dumps(status).encode())

    def _felt(self, message: dict[str, Any]) -> None:
        now_ns = time.monotonic_ns()
        if "wrench" in message:
            force = message["wrench"]["force"]
            self.forces.append((now_ns, force["x"], force["y"], force["z"]))
        elif "data" in message:
            self.servos.append((now_ns, list(message["data"])))

    def look_after(self, now_ns: int) -> None:
        """Nothing is due by itself."""

    def say(self, message: bytes, *, buttons: bool) -> bool:
        """Publish to every client that has subscribed."""
        topic = self._topics.buttons_topic if buttons else self._topics.pose_topic
        sent = False
        for connection, topics in self._clients.values():
            if topic in topics:
                sent = connection.send(message) or sent
                self._left_out += connection.is_blocked
        return sent

    def drop(self, until_ns: int) -> None:
        """Break every connection; no new one until then."""
        self._closed_until_ns = until_ns
        for connection, _ in self._clients.values():
            connection.close()
        self._clients.clear()

    def state(self) -> dict[str, Any]:
        """For the control channel."""
        topics = sorted(set().union(*(one for _, one in self._clients.values())))
        force = self.forces[-1][1:] if self.forces else (0.0, 0.0, 0.0)
        return {
            "clients": len(self._clients),
            "subscribed": topics,
            "left_out": self._left_out,
            "force_n": force,
            "servo_deg": self.servos[-1][1] if self.servos else None,
        }

    def close(self) -> None:
        """Let every client go."""
        self.drop(0)
        self._listener.close()


class LeaseNotTaken(KeyholeError):
    """The console does not let this program drive."""

    code = "lease_not_taken"


def take_lease(base: str, token: str, operator: str) -> str:
    """Take the lease of the console at ``base`` (http://...); returns its identity.

    Raises:
        LeaseNotTaken: somebody else drives, or the console does not answer.
    """
    request = urllib.request.Request(
        base + _LEASE_PATH,
        json.dumps({"operator": operator}).encode(),
        {"Authorization": f"Bearer {token}", "Content-Type": "application/json"},
        method="POST",
    )
    try:
        with urllib.request.urlopen(request, timeout=_CALL_S) as answer:
            return str(json.load(answer)["lease_id"])
    except HTTPError as error:
        problem = forces_in(error.read()) or {}
        raise LeaseNotTaken(f"{base}: {problem.get('detail', error.reason)}") from None
    except (URLError, OSError, ValueError, KeyError) as error:
        raise LeaseNotTaken(f"{base}: {error}") from None


class ConsoleClient:
    """A stylus that speaks to our own WebSocket.

    Args:
        base: of the console, ``http://HOST:PORT``.
        token: of the console.
        lease_id: of whoever drives; empty for nobody.
        renews: whether the lease is renewed with the samples.
    """

    def __init__(self, base: str, token: str, lease_id: str, *, renews: bool) -> None:
        self.wording: RosWording | OwnWording = OwnWording()
        self._url = base.rstrip("/").replace("http", "ws", 1) + STYLUS_PATH
        self._headers = {"Authorization": f"Bearer {token}"}
        if lease_id:
            self._headers["X-Keyhole-Lease"] = lease_id
        self._renews, self._renewed_ns = renews and bool(lease_id), 0
        self._connection: Connection | None = None
        self._next_ns = 0
        self.problem = ""
        self.forces: deque[tuple[int, float, float, float]] = deque(maxlen=_LOGGED)
        self.servos: deque[tuple[int, list[float]]] = deque(maxlen=_LOGGED)

    def descriptors(self) -> list[int]:
        """What to wait on."""
        return [] if self._connection is None else [self._connection.fileno()]

    def serve(self, descriptor: int) -> None:
        """Take what the console says: forces and problems."""
        connection = self._connection
        if connection is None or connection.fileno() != descriptor:
            return
        for text in connection.receive():
            said = forces_in(text) or {}
            if "force_n" in said:
                self.forces.append((time.monotonic_ns(), *said["force_n"]))
            elif "problem" in said:
                self.problem = str(said["problem"].get("detail", ""))
        if connection.closed:
            self.problem = connection.closed
            self.drop(time.monotonic_ns() + _AGAIN_NS)

    def look_after(self, now_ns: int) -> None:
        """Connect anew where the connection is lost."""
        if self._connection is not None or now_ns < self._next_ns:
            return
        try:
            self._connection = connect(self._url, _SHAKE_S, self._headers)
        except ConnectionFailed as error:
            self.problem, self._next_ns = str(error), now_ns + _AGAIN_NS

    def say(self, message: bytes, *, buttons: bool) -> bool:
        """Send a sample."""
        if self._connection is None:
            return False
        now_ns = time.monotonic_ns()
        if self._renews and now_ns - self._renewed_ns > _RENEW_NS and message.endswith(b"}"):
            self._renewed_ns = now_ns
            message = message[:-1] + b',"renew":true}'
        return self._connection.send(message)

    def drop(self, until_ns: int) -> None:
        """Break the connection; no new one until then."""
        self._next_ns = until_ns
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def state(self) -> dict[str, Any]:
        """For the control channel."""
        force = self.forces[-1][1:] if self.forces else (0.0, 0.0, 0.0)
        connected = self._connection is not None
        return {"clients": int(connected), "problem": self.problem, "force_n": force}

    def close(self) -> None:
        """Let the console go."""
        self.drop(0)
