"""Whatever is sent to the console: no server error, no motion, and control does not notice."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import quote

import httpx
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed

from robot.records import Safety
from server.memory.mapped import MappedRing
from tests.server.api_client import ROBOT, ApiClient
from tests.server.console_process import ConsoleProcess
from tests.server.fuzz.json_values import ANY_JSON, SPECIAL, bodies

BOUNDED = settings(
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=1,
    phases=(Phase.generate,),
    suppress_health_check=list(HealthCheck),
)
OPERATIONS, FRAMES = 150, 150

# These do what they say when they are asked for: each has tests of its own.
ACTS = {
    ("POST", f"{ROBOT}/emergency-stop"),
    ("POST", f"{ROBOT}/enable"),
    ("PUT", f"{ROBOT}/board"),
    ("POST", f"{ROBOT}/recording"),
    ("POST", f"{ROBOT}/faults"),
}


class Watched:
    """A disabled console whose every record is looked at."""

    def __init__(self, console: ConsoleProcess, operator: ApiClient) -> None:
        self.console, self.operator = console, operator
        self.ring: MappedRing = console.ring()
        self.said = len(console.errors())
        document = httpx.get(f"{console.base}/openapi.json", headers=self.headers).json()
        self.root: dict[str, Any] = document
        self.operations = [
            (method.upper(), path, operation)
            for path, methods in document["paths"].items()
            for method, operation in methods.items()
            if (method.upper(), path) not in ACTS
        ]
        self.http = httpx.Client(base_url=console.base, timeout=10.0)

    @property
    def headers(self) -> dict[str, str]:
        """Those of the operator."""
        found = {"Authorization": f"Bearer {self.console.token}"}
        lease = self.operator.http.headers.get("X-Keyhole-Lease")
        return {**found, "X-Keyhole-Lease": lease} if lease else found

    def records(self, since: int) -> np.ndarray:
        """Every record from a number on; none may have been lost."""
        found, _, lost = self.ring.read_since(since)
        assert not lost
        return np.asarray(found)


@pytest.fixture
def watched(console: ConsoleProcess, operator: ApiClient) -> Iterator[Watched]:
    one = Watched(console, operator)
    yield one
    one.ring.close()
    one.http.close()
    operator.take_when_free()
    operator.call("POST", "/trocar", {"method": "configuration"})
    operator.done("PUT", "/trocar/breathing", {"amplitude_mm": 0.0})


def check(watched: Watched, since: int, quiet: np.ndarray) -> dict[str, float]:
    """Nothing moved and nothing failed; how late control was, against when nobody spoke."""
    records = watched.records(since)
    state = records["outcome"]["state"]
    assert set(state["safety"].tolist()) <= {int(Safety.DISABLED)}
    assert not records["outcome"]["command"]["moving"].any()
    tip = records["outcome"]["report"]["commanded_position"]
    np.testing.assert_array_equal(tip, np.broadcast_to(tip[0], tip.shape))
    assert np.all(np.diff(records["header"]["tick"]) == 1)
    said = watched.console.errors()[watched.said :]
    assert "Traceback" not in said
    assert watched.operator.state()["control"] == "running"
    figures = {}
    for name, share in (("median", 50), ("p99", 99)):
        before = float(np.percentile(quiet["header"]["lateness_ns"], share))
        figures[name] = float(np.percentile(records["header"]["lateness_ns"], share)) / before
    return figures


def quiet_second(watched: Watched) -> np.ndarray:
    since = watched.ring.sequence
    time.sleep(1.0)
    return watched.records(since)


HEADERS = st.sampled_from(
    ["application/json", "text/plain", "application/x-www-form-urlencoded", "", "application/json;"]
)
TEXTS = st.one_of(st.text(max_size=30), st.sampled_from(["", "..", "%00", "a" * 300, "nan"]))


def call(watched: Watched, data: Any) -> None:
    """One request: an operation, and a body that suits it more or less."""
    method, path, operation = data.draw(st.sampled_from(watched.operations))
    body = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
    strategy = bodies(body["schema"], watched.root) if body else ANY_JSON
    content = data.draw(
        st.one_of(strategy.map(lambda value: json.dumps(value).encode()), st.binary(max_size=40))
    )
    query = {
        one["name"]: data.draw(st.one_of(TEXTS, st.sampled_from(SPECIAL).map(str)))
        for one in operation.get("parameters", ())
        if one["in"] == "query"
    }
    for one in operation.get("parameters", ()):
        if one["in"] == "path":
            given_text = data.draw(TEXTS.filter(lambda text: text not in ("", "..")))
            path = path.replace("{" + one["name"] + "}", quote(given_text, safe=""))
    headers = {**watched.headers, "Content-Type": data.draw(HEADERS)}
    if data.draw(st.booleans()):
        headers.pop("X-Keyhole-Lease", None)
    with contextlib.suppress(httpx.InvalidURL):
        answer = watched.http.request(method, path, content=content, params=query, headers=headers)
        assert answer.status_code < 500 or answer.json()["code"] == "replay_silent", answer.text


def test_no_request_fails_in_the_server_or_moves_the_robot(
    watched: Watched, record_property: Callable[[str, object], None]
) -> None:
    quiet = quiet_second(watched)
    since = watched.ring.sequence

    @settings(BOUNDED, max_examples=OPERATIONS)
    @given(st.data())
    def requests(data: Any) -> None:
        call(watched, data)

    requests()
    for name, ratio in check(watched, since, quiet).items():
        record_property(f"lateness_{name}_ratio", round(ratio, 2))
    watched.operator.forget_lease()


MESSAGES = st.one_of(
    ANY_JSON.map(json.dumps),
    st.text(max_size=80),
    st.sampled_from(["", "{", "[]", '"x"', "{}", '{"type": "leader"}', "x" * 5000]),
    st.fixed_dictionaries(
        {"type": st.sampled_from(["leader", "hold", "heartbeat", "renew", "settings", ""])},
        optional={
            "position_mm": st.one_of(st.lists(st.floats(), max_size=4), ANY_JSON),
            "orientation_wxyz": st.one_of(st.lists(st.floats(), max_size=5), ANY_JSON),
            "clutch": st.one_of(st.booleans(), ANY_JSON),
            "down": ANY_JSON,
            "tick": ANY_JSON,
        },
    ).map(json.dumps),
)


def test_no_frame_breaks_the_stream_or_moves_the_robot(
    watched: Watched, record_property: Callable[[str, object], None]
) -> None:
    quiet = quiet_second(watched)
    since = watched.ring.sequence
    streams = [watched.operator.stream("?rate_hz=5") for _ in range(2)]

    @settings(BOUNDED, max_examples=FRAMES)
    @given(st.integers(0, 1), st.one_of(MESSAGES, st.binary(max_size=60)))
    def frames(place: int, message: str | bytes) -> None:
        try:
            streams[place].send(message)
        except ConnectionClosed:
            # It may hang up on what is no message at all, and must let us in again.
            streams[place] = watched.operator.stream("?rate_hz=5")

    frames()
    for stream in streams:
        stream.close()
    assert watched.operator.state()["safety"]["state"] == "DISABLED"
    for name, ratio in check(watched, since, quiet).items():
        record_property(f"lateness_{name}_ratio", round(ratio, 2))
