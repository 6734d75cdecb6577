"""No token, expired session, foreign Origin, second operator: refused, logged, shown."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from server.web.access import COOKIE, Access, Caller
from server.web.refusals import NotAdmitted, SessionExpired
from tests.server.api_client import JSON, ROBOT, ApiClient, problem_in
from tests.server.console_process import ConsoleProcess, eventually

EVIL = "http://evil.example"


class Clock:
    now = 1_000.0

    def __call__(self) -> float:
        return self.now


def cookie_at(console: ConsoleProcess, admitted_s: float) -> str:
    """A cookie as the console would have made it at another time of its monotonic clock."""
    return Access(console.token, "127.0.0.1", clock=lambda: admitted_s).new_cookie()


def test_a_session_ends_after_its_hours_whatever_the_wall_clock_says() -> None:
    clock = Clock()
    access = Access("token", "127.0.0.1", 2.0, clock)
    cookie = access.new_cookie()
    caller = access.caller({}, {COOKIE: cookie})
    assert access.left_s(caller) == pytest.approx(7200.0, abs=1.0)
    clock.now += 7198.0
    assert access.caller({}, {COOKIE: cookie}).session == caller.session
    clock.now += 2.0
    assert access.session_of(cookie) is None
    assert access.left_s(caller) <= 0.0
    with pytest.raises(SessionExpired) as refusal:
        access.caller({}, {COOKIE: cookie})
    assert isinstance(refusal.value, NotAdmitted)
    assert "open the address that `keyhole` printed" in str(refusal.value)
    # The token itself lasts as long as the console.
    assert access.caller({"authorization": "Bearer token"}, {COOKIE: cookie}).session is None


def test_who_renews_in_time_stays_who_they_are_and_nobody_makes_a_session_longer() -> None:
    clock = Clock()
    access = Access("token", "127.0.0.1", 1.0, clock)
    first = access.new_cookie()
    caller = access.caller({}, {COOKIE: first})
    clock.now += 1800.0
    second = access.new_cookie(first)
    assert access.session_of(second) == caller.session
    # A stream that was opened with the first goes on.
    assert access.left_s(caller) == pytest.approx(3600.0, abs=1.0)
    clock.now += 3700.0
    assert access.session_of(access.new_cookie(second)) != caller.session
    identity, admitted, signature = first.split(".")
    assert access.session_of(f"{identity}.{int(admitted) + 10_000}.{signature}") is None


@pytest.fixture
def stream(operator: ApiClient) -> Iterator[ClientConnection]:
    """The operator's page."""
    opened = operator.stream("?rate_hz=20", **{"X-Keyhole-Lease": lease_of(operator)})
    yield opened
    opened.close()


def lease_of(client: ApiClient) -> str:
    return str(client.http.headers["X-Keyhole-Lease"])


def shown(stream: ClientConnection, says: Callable[[str], bool], within_s: float = 15.0) -> str:
    """The notice on the operator's page that says so; keeps the page alive meanwhile."""
    ends = time.monotonic() + within_s
    while time.monotonic() < ends:
        stream.send(json.dumps({"type": "heartbeat"}))
        stream.send(json.dumps({"type": "renew"}))
        message = json.loads(stream.recv(5.0))
        if message["type"] == "notice" and says(message["text"]):
            return str(message["text"])
    raise AssertionError("no such notice")


def logged(client: ApiClient, code: str, **fields: str) -> JSON:
    """The newest refusal with that code in the audit log."""

    def find() -> JSON | None:
        answer = client.http.get("/audit", params={"last": 200})
        assert answer.status_code == 200
        entries: list[JSON] = answer.json()
        wanted = {"event": "refused", "code": code, **fields}
        found = [one for one in entries if wanted.items() <= one.items()]
        return found[-1] if found else None

    entry = eventually(find, f"{code} is logged")
    assert isinstance(entry, dict)
    return entry


Send = Callable[[ConsoleProcess], httpx.Response]


def _get(console: ConsoleProcess, path: str, **headers: str) -> httpx.Response:
    return httpx.get(f"{console.base}{path}", headers=headers, timeout=10.0)


def _post(console: ConsoleProcess, path: str, **headers: str) -> httpx.Response:
    return httpx.post(f"{console.base}{path}", headers=headers, timeout=10.0)


REFUSED: dict[str, tuple[str, int, str, Send]] = {
    "no token": (
        "not_admitted", 401, "without a token tried to enable the robot",
        lambda console: _post(console, f"{ROBOT}/enable"),
    ),
    "wrong token": (
        "wrong_token", 401, "with a wrong or expired token tried to reset a fault",
        lambda console: _post(console, f"{ROBOT}/reset", Authorization="Bearer old"),
    ),
    "expired session": (
        "session_expired", 401, "whose session has ended tried to play a path",
        lambda console: _post(
            console, f"{ROBOT}/path", Cookie=f"{COOKIE}={cookie_at(console, -1e6)}"
        ),
    ),
    "foreign origin": (
        "foreign_origin", 403, f"a page of {EVIL} tried to disable the robot",
        lambda console: _post(
            console, f"{ROBOT}/disable", Origin=EVIL,
            Cookie=f"{COOKIE}={cookie_at(console, time.monotonic())}",
        ),
    ),
    "foreign host": (
        "foreign_host", 421, "evil.example tried to read the state",
        lambda console: _get(
            console, f"{ROBOT}/state", Host="evil.example",
            Authorization=f"Bearer {console.token}",
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_who_may_not_speak_is_refused_logged_and_shown(
    operator: ApiClient, stream: ClientConnection, console: ConsoleProcess, case: str
) -> None:
    code, status, words, send = REFUSED[case]
    before = operator.state()
    answer = send(console)
    assert answer.status_code == status
    assert problem_in(answer)["code"] == code
    assert words in shown(stream, lambda text: words in text)
    entry = logged(operator, code)
    assert words in entry["text"]
    assert entry["address"] == "127.0.0.1"
    assert console.token not in json.dumps(entry)
    after = operator.state()
    assert after["safety"] == before["safety"]
    assert after["joints_deg"] == before["joints_deg"]


def test_a_second_operator_is_refused_logged_and_shown(
    operator: ApiClient, stream: ClientConnection, watcher: ApiClient
) -> None:
    operator.done("POST", "/lease/renew")
    problem = watcher.refused("POST", "/lease", {"operator": "Eve"})
    assert (problem["status"], problem["code"]) == (409, "lease_held")
    words = "Eve (at 127.0.0.1) tried to take control"
    assert words in shown(stream, lambda text: "Eve" in text)
    assert words in logged(operator, "lease_held")["text"]

    def refused_and_shown() -> bool:
        problem = watcher.refused("PUT", "/priority", {"case": "2"})
        assert problem["code"] == "not_the_operator"
        try:
            return bool(shown(stream, lambda text: "tried to change the priority" in text, 6.0))
        except AssertionError:
            # Another test was turned away alike a moment ago: that is not told again so soon.
            return False

    eventually(refused_and_shown, "the operator is told", 60.0)
    entry = logged(operator, "not_the_operator", path=f"{ROBOT}/priority")
    assert entry["body"] == {"case": "2"}
    assert operator.state()["operator"]["name"] == "Ada"
    assert operator.state()["priority"]["case"] == "1"


def test_an_expired_session_gets_a_page_that_says_how_to_get_in(console: ConsoleProcess) -> None:
    answer = _get(console, "/", Cookie=f"{COOKIE}={cookie_at(console, -1e6)}")
    assert answer.status_code == 401
    assert "session has ended" in answer.text
    assert "/?token=" in answer.text


def test_a_stream_ends_with_its_session(console: ConsoleProcess, watcher: ApiClient) -> None:
    hours = watcher.http.get("/configuration").json()["server"]["session_hours"]
    almost = time.monotonic() - hours * 3600.0 + 3.0
    cookie = f"{COOKIE}={cookie_at(console, almost)}"
    nobody = ApiClient(console, "")
    address = console.base.replace("http", "ws", 1) + f"{ROBOT}/stream"
    stream = connect(address, additional_headers={"Cookie": cookie}, proxy=None)
    warned = False
    ends = time.monotonic() + 30.0
    with contextlib.suppress(ConnectionClosed):
        while time.monotonic() < ends:
            message = json.loads(stream.recv(15.0))
            warned = warned or (message["type"] == "notice" and "session ends" in message["text"])
    assert time.monotonic() < ends
    assert warned
    assert nobody.refused("GET", "/state", Cookie=cookie)["code"] == "session_expired"
    nobody.close()


def test_a_flood_of_refusals_is_counted_not_written(
    operator: ApiClient, console: ConsoleProcess
) -> None:
    with httpx.Client(base_url=console.base, timeout=10.0) as flood:
        for _ in range(150):
            assert flood.get(f"{ROBOT}/faults").status_code == 401
    entries = operator.http.get("/audit", params={"last": 1000}).json()
    same = [
        one for one in entries if one["event"] == "refused" and one.get("path") == f"{ROBOT}/faults"
    ]
    assert 1 <= len(same) <= 10


def test_every_request_stands_in_the_log_with_who_asked(driver: ApiClient) -> None:
    driver.done("PUT", "/teleoperation", {"motion_scale": 0.5})
    driver.refused("PUT", "/teleoperation", {"motion_scale": -1})
    start = driver.state()["true"]["position_mm"]
    for _ in range(50):
        driver.done("POST", "/target", {"position_mm": start})

    def entries(path: str) -> list[JSON]:
        found: list[JSON] = driver.http.get("/audit", params={"last": 400}).json()
        return [one for one in found if one["event"] == "request" and one["path"] == ROBOT + path]

    def settings() -> list[JSON]:
        return entries("/teleoperation")[-2:]

    eventually(lambda: len(settings()) == 2 and settings()[1]["status"] == 422, "both are logged")
    good, bad = settings()
    assert (good["by"], good["status"]) == ("Ada", 200)
    assert good["body"] == {"motion_scale": 0.5}
    assert "refused" in bad["text"]
    assert len(entries("/target")) < 20
    log = driver.http.get("/audit", params={"last": 400}).json()
    events = {one["event"] for one in log}
    assert {"lease_taken", "state_changed", "process_started", "request"} <= events
    since = log[-10]["time"]
    later = driver.http.get("/audit", params={"since": since}).json()
    assert all(one["time"] > since for one in later)
    assert driver.http.get("/audit", params={"since": "yesterday"}).status_code == 422
    assert driver.http.get("/audit", params={"last": 0}).status_code == 422


def test_a_part_of_a_page_that_fails_is_logged(driver: ApiClient) -> None:
    def page_failures() -> list[Any]:
        log = driver.http.get("/audit").json()
        return [one for one in log if one["event"] == "page_failed"]

    with driver.stream() as stream:
        stream.send(json.dumps({"type": "page-error", "words": "plots: TypeError"}))
        stream.send(json.dumps({"type": "page-error", "words": "plots: TypeError"}))
        eventually(page_failures, "it is logged")
        assert len(page_failures()) == 1
    assert Caller("a", None).ends == float("inf")
