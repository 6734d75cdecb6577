"""Our own WebSocket for a stylus: who may lead over it, and what comes back."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.sync.connection import Connection

from robot.configuration import Configuration
from server.fake_stylus.outlets import STYLUS_PATH, LeaseNotTaken, take_lease
from server.leaders.led_stylus import NO_FORCE
from server.memory.link import WebLink
from server.web.lease import Lease
from server.web.refusals import NotReady, UnreadableRequest
from server.web.stylus_bridge import LARGEST_MESSAGE, StylusBridge, read_sample
from tests.server.api_client import JSON, ApiClient, newest
from tests.server.console_process import eventually

IDENTITY = [1.0, 0.0, 0.0, 0.0]


def bridge(client: ApiClient, **headers: str) -> ClientConnection:
    """A bridge under the client's token and lease."""
    sent = {"Authorization": client.http.headers["Authorization"], **headers}
    if "X-Keyhole-Lease" in client.http.headers:
        sent["X-Keyhole-Lease"] = client.http.headers["X-Keyhole-Lease"]
    address = client.console.base.replace("http", "ws", 1) + STYLUS_PATH
    return connect(
        address, additional_headers=sent, compression=None, proxy=None, close_timeout=0.2
    )


def tell(stylus: Connection, x_mm: float = 0.0, buttons: int = 0, **more: Any) -> None:
    """One sample, stamped."""
    sample: JSON = {"position_mm": [x_mm, 0.0, 0.0], "orientation_wxyz": IDENTITY}
    stylus.send(json.dumps({**sample, "buttons": buttons, "stamp_ns": time.monotonic_ns(), **more}))


def lead(stylus: Connection, client: ApiClient, until: Callable[[JSON], Any]) -> JSON:
    """Move 5 mm with the first button held, until the state is as wanted."""
    for _ in range(20):
        tell(stylus)
        time.sleep(0.002)
    for step in range(4000):
        tell(stylus, min(0.05 * step, 5.0), 1)
        time.sleep(0.004)
        if step % 20 == 0:
            state = client.state()
            if until(state):
                return state
    raise AssertionError(f"not in time: {state['safety']}, {client.done('GET', '/leaders')}")


def test_a_bridge_leads_and_feels(driver: ApiClient) -> None:
    start = np.array(driver.state()["true"]["position_mm"])
    with bridge(driver) as stylus:

        def moved(state: JSON) -> bool:
            way = np.array(state["true"]["position_mm"]) - start
            return bool(way[0] > 4.9)

        state = lead(stylus, driver, moved)
        assert (state["leader"], state["engaged"]) == ("stylus", True)
        told = driver.done("GET", "/leaders")["stylus"]
        assert told["source"] == "websocket"
        assert told["connected"]
        assert told["clutch"]
        assert told["mode"] == "both"
        assert told["rate_hz"] > 20.0
        assert told["counts"]["invalid"] == 0
        felt = newest(stylus, "force")
        assert len(felt["force_n"]) == 3
        for _ in range(5):
            tell(stylus, 5.0, 0)
        driver.until(lambda s: not s["engaged"], "let go")
    assert driver.state()["safety"]["state"] == "ENABLED"


def test_a_bridge_that_breaks_off_while_it_leads_pauses(driver: ApiClient) -> None:
    with bridge(driver) as stylus:
        lead(stylus, driver, lambda state: state["engaged"])
    state = driver.until(lambda s: s["safety"]["state"] == "PAUSED", "the silence is seen")
    assert state["safety"]["reason_code"] == "leader_stale"
    eventually(lambda: not driver.done("GET", "/leaders")["stylus"]["connected"], "it is gone")


def test_a_pose_that_is_none_pauses(driver: ApiClient) -> None:
    def invalid() -> int:
        return int(driver.done("GET", "/leaders")["stylus"]["counts"]["invalid"])

    with bridge(driver) as stylus:
        lead(stylus, driver, lambda state: state["engaged"])
        before = invalid()
        tell(stylus, float("nan"), 1)
        state = driver.until(lambda s: s["safety"]["state"] == "PAUSED", "it is seen")
        assert state["safety"]["reason_code"] == "leader_invalid"
        eventually(lambda: invalid() == before + 1, "it is counted")


def test_who_has_no_lease_leads_nothing(driver: ApiClient, watcher: ApiClient) -> None:
    with bridge(watcher) as stylus:
        tell(stylus, 0.0, 1)
        assert newest(stylus, "problem")["problem"]["code"] == "not_the_operator"
        tell(stylus, 0.0, 0, renew=True)
    assert not driver.state()["engaged"]


@pytest.mark.parametrize(
    "headers",
    [{"Authorization": "Bearer wrong"}, {"Authorization": ""}, {"Origin": "http://evil.example"}],
)
def test_who_may_not_enter_is_refused(driver: ApiClient, headers: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus) as refusal:
        bridge(driver, **headers)
    assert refusal.value.response.status_code in (401, 403)


def test_one_bridge_at_a_time(driver: ApiClient) -> None:
    with bridge(driver) as first, bridge(driver) as second:
        for _ in range(10):
            tell(first)
            tell(second, 50.0, 1)
            time.sleep(0.01)
        assert "another bridge" in newest(second, "problem")["problem"]["detail"]
        assert not driver.state()["engaged"]


def test_nonsense_is_counted_and_the_bridge_goes_on(driver: ApiClient) -> None:
    with bridge(driver) as stylus:
        tell(stylus)
        before = driver.done("GET", "/leaders")["stylus"]["counts"]
        stylus.send("nonsense")
        stylus.send("x" * 2000)
        assert newest(stylus, "problem")["problem"]["code"] == "unreadable_request"
        tell(stylus)

        def counted() -> bool:
            now = driver.done("GET", "/leaders")["stylus"]["counts"]
            return bool(
                now["malformed"] == before["malformed"] + 1
                and now["oversized"] == before["oversized"] + 1
            )

        eventually(counted, "both are counted")
        assert newest(stylus, "force")["force_n"] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "null", "{}", '{"position_mm":[0,0],"orientation_wxyz":[1,0,0,0],"buttons":0}',
        '{"position_mm":[0,0,0],"orientation_wxyz":[1,0,0,0],"buttons":4}',
        '{"position_mm":[0,0,0],"orientation_wxyz":[1,0,0,0],"buttons":0.5}',
        '{"position_mm":[0,0,0],"orientation_wxyz":[1,0,0,0],"buttons":0,"stamp_ns":-1}',
        '{"position_mm":[0,0,0],"orientation_wxyz":[1,0,0,0],"buttons":0,"scale":9}',
        '{"position_mm":["0",0,0],"orientation_wxyz":[1,0,0,0],"buttons":0}',
        '{"position_mm":[1e999,0,0],"orientation_wxyz":[1,0,0,0],"buttons":NaN}',
        "[" * 900, " " * (LARGEST_MESSAGE + 1),
    ],
)  # fmt: skip
def test_what_is_no_sample_is_refused(text: str) -> None:
    with pytest.raises(UnreadableRequest) as refusal:
        read_sample(text.encode())
    assert "\n" not in str(refusal.value)


def test_a_lease_for_a_program(driver: ApiClient) -> None:
    base, token = driver.console.base, driver.console.token
    with pytest.raises(LeaseNotTaken, match="Ada"):
        take_lease(base, token, "Grace")
    with pytest.raises(LeaseNotTaken):
        take_lease(base, "wrong", "Ada")


@pytest.mark.parametrize("scale", [0.0, -1.0, float("inf"), float("nan")])
def test_a_scale_that_makes_no_sense_is_refused(driver: ApiClient, scale: float) -> None:
    driver.refused("PUT", "/teleoperation", {"motion_scale": scale})
    assert driver.state()["teleoperation"]["motion_scale"] == 1.0


def test_where_a_rosbridge_leads_there_is_no_second_stylus(
    directory: Path, configuration: Configuration
) -> None:
    stylus = configuration.stylus.model_copy(update={"source": "rosbridge"})
    link = WebLink(directory)
    elsewhere = StylusBridge(link, Lease(5.0), configuration.model_copy(update={"stylus": stylus}))
    with pytest.raises(NotReady, match="rosbridge"):
        elsewhere.check()
    assert elsewhere.force(object()) == (NO_FORCE, False)
    elsewhere.left(object())
    assert elsewhere.status() is None, "its process has not spoken"
    link.close()
