"""The console's public API, for a program that expects to be refused."""

from __future__ import annotations

import contextlib
import http.client
import json
import threading
import urllib.parse
from typing import Any, NamedTuple

from server.web.api_robot import robot_path

ROBOT = robot_path("instrument")


class Answer(NamedTuple):
    """What the console answered: status and parsed body; 0 and nothing where nobody answered.

    ``body`` holds an object, ``items`` a list, whichever came.
    """

    status: int
    body: dict[str, Any]
    items: list[dict[str, Any]]

    @property
    def ok(self) -> bool:
        """Whether it did what was asked."""
        return 200 <= self.status < 300


class Api:
    """Calls under ``/api/v1/robots/instrument``, from any thread.

    Args:
        base: the console's address.
        token: its token.

    Attributes:
        lease: sent with every call where it is not empty.
    """

    def __init__(self, base: str, token: str) -> None:
        self.base, self._token, self.lease = base, token, ""
        self._place = urllib.parse.urlsplit(base).netloc
        self._lock = threading.Lock()

    @property
    def headers(self) -> dict[str, str]:
        """What identifies the caller."""
        found = {"Authorization": f"Bearer {self._token}"}
        return {**found, "X-Keyhole-Lease": self.lease} if self.lease else found

    @property
    def stream_address(self) -> str:
        """Of the stream, without a query."""
        return self.base.replace("http://", "ws://") + ROBOT + "/stream"

    def call(
        self, method: str, path: str, body: Any = None, timeout_s: float = 5.0, **headers: str
    ) -> Answer:
        """Ask; nothing is raised, whatever comes back.

        Args:
            method: GET, PUT, ...
            path: after the robot's.
            body: sent as JSON, NaN and infinity included; None for none.
            timeout_s: how long to wait for the answer, s.
            **headers: take the place of the usual ones.
        """
        content = None if body is None else json.dumps(body)
        sent = {**self.headers, "Content-Type": "application/json", **headers}
        connection = http.client.HTTPConnection(self._place, timeout=timeout_s)
        try:
            connection.request(method, ROBOT + path, content, sent)
            answer = connection.getresponse()
            text = answer.read()
        except (OSError, http.client.HTTPException):
            return Answer(0, {}, [])
        finally:
            connection.close()
        found: Any = None
        with contextlib.suppress(ValueError):
            found = json.loads(text)
        body = found if isinstance(found, dict) else {}
        return Answer(answer.status, body, found if isinstance(found, list) else [])

    def take_lease(self, name: str = "fault table") -> bool:
        """Become the operator, or stay it."""
        with self._lock:
            if self.lease and self.call("POST", "/lease/renew").ok:
                return True
            self.lease = ""
            granted = self.call("POST", "/lease", {"operator": name})
            self.lease = str(granted.body.get("lease_id", ""))
            return granted.ok

    def state(self) -> dict[str, Any]:
        """The state message; empty while nobody answers."""
        return self.call("GET", "/state").body
