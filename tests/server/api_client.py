"""A program that speaks to the console's API, as tests need it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import httpx
from websockets.sync.client import ClientConnection, connect
from websockets.sync.connection import Connection

from server.web.api_robot import robot_path
from tests.server.console_process import ConsoleProcess, eventually

JSON = dict[str, Any]

ROBOT = robot_path("instrument")


class ApiClient:
    """Calls the API under the path of the console's robot.

    Args:
        console: a running console.
        token: sent with every request; None for the console's own, empty for none.
    """

    def __init__(self, console: ConsoleProcess, token: str | None = None) -> None:
        self.console = console
        token = console.token if token is None else token
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        self.http = httpx.Client(
            base_url=console.base + console.robot_path, headers=headers, timeout=10.0
        )

    def close(self) -> None:
        self.http.close()

    def call(self, method: str, path: str, body: Any = None, **headers: str) -> httpx.Response:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        if body is None:
            return self.http.request(method, path, headers=named)
        # Python's own encoder, for it writes NaN and Infinity.
        content = json.dumps(body)
        named["Content-Type"] = "application/json"
        return self.http.request(method, path, content=content, headers=named)

    def done(self, method: str, path: str, body: Any = None) -> JSON:
        """Call what must succeed."""
        answer = self.call(method, path, body)
        assert answer.is_success, answer.text
        found = answer.json() if answer.content else {}
        assert isinstance(found, dict)
        return found

    def refused(self, method: str, path: str, body: Any = None, **headers: str) -> JSON:
        """Call what must be refused with a problem document."""
        answer = self.call(method, path, body, **headers)
        return problem_in(answer)

    def state(self) -> JSON:
        return self.done("GET", "/state")

    def take(self, name: str = "Ada") -> JSON:
        lease = self.done("POST", "/lease", {"operator": name})
        self.http.headers["X-Keyhole-Lease"] = lease["lease_id"]
        return lease

    def take_when_free(self, name: str = "Ada") -> None:
        """Take the lease unless it is held already; waits for another's to expire."""
        if self.call("POST", "/lease/renew").is_success:
            return
        self.forget_lease()
        eventually(lambda: self.state()["operator"]["name"] is None, "the lease is free")
        self.take(name)

    def forget_lease(self) -> None:
        self.http.headers.pop("X-Keyhole-Lease", None)

    def until(self, condition: Callable[[JSON], Any], what: str, within_s: float = 10.0) -> JSON:
        """The first state for which ``condition`` holds; keeps the lease meanwhile."""
        ends = time.monotonic() + within_s
        while time.monotonic() < ends:
            state = self.state()
            if condition(state):
                return state
            if "X-Keyhole-Lease" in self.http.headers:
                self.call("POST", "/lease/renew")
            time.sleep(0.02)
        raise AssertionError(f"not within {within_s:g} s: {what}; safety {state['safety']}")

    def stream(self, query: str = "", **headers: str) -> ClientConnection:
        """Open the stream, with the lease if there is one."""
        sent = {"Authorization": self.http.headers["Authorization"], **headers}
        if "X-Keyhole-Lease" in self.http.headers:
            sent["X-Keyhole-Lease"] = self.http.headers["X-Keyhole-Lease"]
        address = self.console.base.replace("http://", "ws://")
        address += self.console.robot_path + "/stream" + query
        # A client that has stopped reading does not see the answer when it closes.
        return connect(
            address, additional_headers=sent, compression=None, proxy=None, close_timeout=0.2
        )


def problem_in(answer: httpx.Response) -> JSON:
    """The problem document of a refusal, checked against RFC 9457."""
    assert 400 <= answer.status_code < 500, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert isinstance(problem, dict)
    assert problem["status"] == answer.status_code
    assert {"type", "title", "detail", "code"} <= problem.keys()
    assert "Traceback" not in answer.text
    assert "\n" not in problem["detail"]
    return problem


def newest(stream: Connection, kind: str = "state") -> JSON:
    """The next message of a kind."""
    while True:
        message = json.loads(stream.recv(timeout=5.0))
        if message["type"] == kind:
            assert isinstance(message, dict)
            return message
