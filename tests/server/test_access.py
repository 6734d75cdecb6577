"""The door: token, session cookie, Origin, Host, size of bodies, headers."""

from __future__ import annotations

import re
from collections.abc import Iterator

import httpx
import pytest
from websockets.exceptions import InvalidStatus

from server.web.access import COOKIE, Access, names_of
from server.web.access_guard import LARGEST_BODY
from server.web.page_headers import headers_for
from server.web.refusals import ForeignHost, ForeignOrigin, NotAdmitted
from tests.server.api_client import ROBOT, ApiClient, problem_in
from tests.server.console_process import ConsoleProcess

TOKEN = "a-token-for-this-test"


@pytest.fixture
def access() -> Access:
    return Access(TOKEN, "127.0.0.1")


@pytest.fixture
def browser(console: ConsoleProcess) -> Iterator[httpx.Client]:
    """Keeps cookies and follows nothing."""
    with httpx.Client(base_url=console.base, timeout=10.0) as client:
        yield client


def test_only_the_token_is_the_token(access: Access) -> None:
    assert access.token_is(TOKEN)
    for wrong in (None, "", TOKEN[:-1], TOKEN + " ", TOKEN.upper(), "é", "x" * 100_000):
        assert not access.token_is(wrong)


def test_a_session_cookie_proves_its_session_and_no_other(access: Access) -> None:
    first, second = access.new_cookie(), access.new_cookie()
    assert access.session_of(first) == first.partition(".")[0]
    assert access.session_of(first) != access.session_of(second)
    forged = first.partition(".")[0] + "." + second.partition(".")[2]
    for wrong in (None, "", "x", ".", forged, first[:-1], first + "é", "y" * 10_000):
        assert access.session_of(wrong) is None


def test_a_restarted_server_knows_the_session_and_a_new_token_ends_it(access: Access) -> None:
    cookie = access.new_cookie()
    assert Access(TOKEN, "127.0.0.1").session_of(cookie) is not None
    assert Access("another-token", "127.0.0.1").session_of(cookie) is None


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8000", "localhost:8000", "LOCALHOST:8000", "[::1]:8000", "localhost"]
)
def test_own_hosts_are_known(access: Access, host: str) -> None:
    name, port = access.check_host(host)
    assert name
    assert port == (8000 if ":8000" in host else 80)


@pytest.mark.parametrize(
    "host",
    ["", "evil.example", "evil.example:8000", "127.0.0.1.evil.example", "localhost:x",
     "a@localhost", "localhost/path", "10.0.0.1:8000", "localhost:99999999", "[::1", "x" * 5000],
)  # fmt: skip
def test_foreign_hosts_are_refused(access: Access, host: str) -> None:
    with pytest.raises(ForeignHost):
        access.check_host(host)


def test_a_server_on_all_interfaces_answers_to_addresses_but_not_to_foreign_names() -> None:
    everywhere = Access(TOKEN, "0.0.0.0")
    assert everywhere.check_host("192.0.2.7:8000") == ("192.0.2.7", 8000)
    with pytest.raises(ForeignHost):
        everywhere.check_host("evil.example:8000")
    assert "localhost" in names_of("::")
    assert names_of("::1") == names_of("127.0.0.1")
    assert "robot.local" in names_of("Robot.local")


@pytest.mark.parametrize("origin", [None, "http://localhost:8000", "http://127.0.0.1:8000"])
def test_own_origins_pass(access: Access, origin: str | None) -> None:
    access.check_origin(origin, 8000)


@pytest.mark.parametrize(
    "origin",
    ["null", "", "http://evil.example", "http://localhost:9000", "http://localhost", "file://",
     "http://localhost:8000.evil.example", "chrome-extension://localhost:8000", "localhost:8000"],
)  # fmt: skip
def test_foreign_origins_are_refused(access: Access, origin: str) -> None:
    with pytest.raises(ForeignOrigin):
        access.check_origin(origin, 8000)


def test_nobody_is_admitted_without_token_or_session(access: Access) -> None:
    cookie = access.new_cookie()
    assert access.caller({"authorization": f"Bearer {TOKEN}"}, {}).session is None
    assert access.caller({"authorization": f"bearer {TOKEN}"}, {}).session is None
    assert access.caller({}, {COOKIE: cookie}).session is not None
    for headers in ({}, {"authorization": "Bearer x"}, {"authorization": f"Basic {TOKEN}"}):
        with pytest.raises(NotAdmitted):
            access.caller(headers, {COOKIE: "x.y"})


def test_the_printed_address_lets_a_browser_in(
    browser: httpx.Client, console: ConsoleProcess
) -> None:
    answer = browser.get(f"/?token={console.token}")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert {"httponly", "samesite=strict", "path=/"} <= set(cookie.split("; "))
    assert console.token not in cookie
    assert browser.get("/").status_code == 200
    assert browser.get(f"{ROBOT}/state").status_code == 200
    assert browser.get("/assets/app.js").status_code == 200


def test_others_see_how_to_get_in(browser: httpx.Client) -> None:
    for path in ("/", "/?token=wrong", "/?token=", "/docs", "/viser/", "/assets/app.js"):
        answer = browser.get(path)
        assert answer.status_code == 401
        assert "token" in answer.text
        assert "set-cookie" not in answer.headers


@pytest.mark.parametrize("token", ["", "wrong"])
def test_the_api_is_closed_without_the_token(console: ConsoleProcess, token: str) -> None:
    client = ApiClient(console, token)
    code = "wrong_token" if token else "not_admitted"
    for method, path in (("GET", "/state"), ("POST", "/emergency-stop"), ("GET", "/no-such-thing")):
        problem = client.refused(method, path)
        assert (problem["status"], problem["code"]) == (401, code)
    client.close()
    assert ApiClient(console).state()["safety"]["state"] == "DISABLED"


def test_health_needs_no_token(browser: httpx.Client) -> None:
    health = browser.get("/api/v1/health").json()
    assert health["status"] == "ok"
    assert health["scene"] in ("loading", "ready")


def test_a_foreign_page_is_refused_even_with_the_session(
    browser: httpx.Client, console: ConsoleProcess
) -> None:
    browser.get(f"/?token={console.token}")
    for path in (f"{ROBOT}/emergency-stop", f"{ROBOT}/lease"):
        answer = browser.post(path, headers={"Origin": "http://evil.example"})
        assert problem_in(answer)["code"] == "foreign_origin"
    own = browser.get(f"{ROBOT}/state", headers={"Origin": console.base})
    assert own.status_code == 200


def test_a_foreign_host_is_refused(browser: httpx.Client, console: ConsoleProcess) -> None:
    headers = {"Host": "evil.example", "Authorization": f"Bearer {console.token}"}
    answer = browser.get(f"{ROBOT}/state", headers=headers)
    assert (answer.status_code, problem_in(answer)["code"]) == (421, "foreign_host")


@pytest.mark.parametrize(
    ("headers", "status"),
    [({"Origin": "http://evil.example"}, 403), ({"Authorization": "Bearer wrong"}, 401)],
)
def test_the_websocket_has_the_same_door(
    watcher: ApiClient, headers: dict[str, str], status: int
) -> None:
    with pytest.raises(InvalidStatus) as refusal:
        watcher.stream(**headers)
    assert refusal.value.response.status_code == status
    assert b"problem" in refusal.value.response.headers["content-type"].encode()


def test_large_bodies_are_not_read(operator: ApiClient) -> None:
    problem = operator.refused("PUT", "/priority", {"case": "x" * LARGEST_BODY})
    assert problem["status"] == 413
    chunks = (b"[" * 8192 for _ in range(64))
    answer = operator.http.post(
        "/lease", content=chunks, headers={"Content-Type": "application/json"}
    )
    assert answer.status_code == 413
    problem_in(answer)


def test_every_answer_says_what_its_page_may_do(watcher: ApiClient) -> None:
    http = watcher.http
    base = watcher.console.base
    for path in ("/", "/docs", "/viser/", f"{ROBOT}/state", "/assets/app.js"):
        headers = http.get(base + path).headers
        assert headers["x-content-type-options"] == "nosniff"
        assert "frame-ancestors" in headers["content-security-policy"]
        assert headers["cache-control"] in ("no-cache", "no-store")
    assert "unsafe" not in http.get(base + "/").headers["content-security-policy"]
    assert "'none'" in headers_for("/api/v1/health")["Content-Security-Policy"]


def test_the_documentation_needs_no_other_server(watcher: ApiClient) -> None:
    base = watcher.console.base
    page = watcher.http.get(base + "/docs")
    assert page.status_code == 200
    links = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert len(links) >= 3
    for link in links:
        assert link.startswith("/")
        assert watcher.http.get(base + link).status_code == 200


def test_the_openapi_document_describes_every_operation(watcher: ApiClient) -> None:
    document = watcher.http.get(watcher.console.base + "/openapi.json").json()
    operations = [
        (path, method, operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    assert len(operations) >= 20
    for path, method, operation in operations:
        assert path.startswith("/api/v1/")
        assert operation["summary"], (path, method)
        assert operation["description"], (path, method)
    for name, schema in document["components"]["schemas"].items():
        if name in ("TargetPose", "LeaderPose"):
            for field in schema["properties"].values():
                assert "description" in field
