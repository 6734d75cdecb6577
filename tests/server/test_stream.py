"""The stream: rate, presses and heartbeats, lost operators, slow clients."""

from __future__ import annotations

import json
import socket
import time
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.connection import Connection

from server.web.operator_watch import HEARTBEAT_S
from server.web.refusals import UnreadableRequest
from server.web.state_schema import StateMessage
from server.web.stream import LARGEST_MESSAGE, Hold, LeaderMessage, Progress, read_message
from tests.server.api_client import JSON, ApiClient, newest

IDENTITY = [1.0, 0.0, 0.0, 0.0]


def send(stream: Connection, **message: Any) -> None:
    stream.send(json.dumps(message))


def test_states_come_thirty_times_a_second(watcher: ApiClient) -> None:
    with watcher.stream("?rate_hz=30") as stream:
        newest(stream)
        began, ticks = time.monotonic(), []
        while time.monotonic() - began < 2.0:
            state = newest(stream)
            ticks.append(state["tick"])
    StateMessage.model_validate(state)
    assert 10.0 <= len(ticks) / 2.0 <= 32.0, "fewer only on a busy machine, more never"
    assert ticks == sorted(ticks)


def test_twenty_clients_are_served_alike(watcher: ApiClient) -> None:
    streams = [watcher.stream("?rate_hz=30") for _ in range(20)]
    time.sleep(1.0)
    now = watcher.state()["tick"]
    began = time.monotonic()
    for stream in streams:
        while newest(stream)["tick"] < now:
            assert time.monotonic() - began < 10.0, "a client is far behind"
        stream.close()


@pytest.mark.parametrize("rate", ["0", "-1", "nan", "inf", "1000", "fast"])
def test_a_senseless_rate_is_refused(watcher: ApiClient, rate: str) -> None:
    with pytest.raises(InvalidStatus) as refusal:
        watcher.stream(f"?rate_hz={rate}")
    assert 400 <= refusal.value.response.status_code < 500


def test_messages_are_read_as_they_are_meant() -> None:
    assert read_message('{"type":"hold","down":true}') == Hold(type="hold", down=True)
    pose = '"position_mm":[1,2,3],"orientation_wxyz":[2,0,0,0],"clutch":false'
    message = read_message('{"type":"leader",' + pose + "}")
    assert isinstance(message, LeaderMessage)
    assert message.orientation_wxyz == (1.0, 0.0, 0.0, 0.0)
    stop = read_message('{"type":"emergency-stop","why":"whatever else stands here"}')
    assert stop.type == "emergency-stop"


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "null", '"hold"', "{}", '{"type":"dance"}', '{"type":"hold"}',
        '{"type":"hold","down":"yes"}', '{"type":"heartbeat","tick":-1}',
        '{"type":"leader","position_mm":[NaN,0,0],"orientation_wxyz":[1,0,0,0],"clutch":true}',
        '{"type":"leader","position_mm":[0,0,0],"orientation_wxyz":[0,0,0,0],"clutch":true}',
        '{"type":"leader","position_mm":[1e999,0,0],"orientation_wxyz":[1,0,0,0],"clutch":true}',
        "[" * 4000, " " * (LARGEST_MESSAGE + 1), '{"type":"hold","down":true,"x":"' + "y" * 4096,
    ],
)  # fmt: skip
def test_bad_messages_are_refused(text: str) -> None:
    with pytest.raises(UnreadableRequest) as refusal:
        read_message(text)
    assert "\n" not in str(refusal.value)


def test_a_refused_message_is_answered_and_the_stream_goes_on(watcher: ApiClient) -> None:
    with watcher.stream() as stream:
        stream.send("nonsense")
        assert newest(stream, "problem")["problem"]["code"] == "unreadable_request"
        stream.send(b"\x00\x01")
        assert newest(stream, "problem")["problem"]["code"] == "unreadable_request"
        send(stream, type="hold", down=True)
        assert newest(stream, "problem")["problem"]["code"] == "not_the_operator"
        send(stream, type="renew")
        assert newest(stream, "problem")["problem"]["code"] == "not_the_operator"
        assert newest(stream)["hold"] is False


def test_anyone_stops_over_the_stream(driver: ApiClient, watcher: ApiClient) -> None:
    with watcher.stream() as stream:
        send(stream, type="emergency-stop")
        state = driver.until(lambda s: s["safety"]["state"] == "FAULT", "the stop", 1.0)
    assert state["safety"]["reason_code"] == "emergency_stop"


def test_a_leader_over_the_stream_moves_the_tip(driver: ApiClient) -> None:
    start = np.array(driver.state()["true"]["position_mm"])
    with driver.stream() as stream:
        pose: JSON = {"orientation_wxyz": IDENTITY}
        for step in range(200):
            pose["position_mm"] = [0.0, min(0.1 * step, 10.0), 0.0]
            send(stream, type="leader", **pose, clutch=True)
            send(stream, type="heartbeat")
            time.sleep(0.01)
        state = driver.state()
        send(stream, type="leader", **pose, clutch=False)
        driver.until(lambda s: not s["engaged"], "let go")
    assert state["leader"] == "api_pose"
    assert np.array(state["true"]["position_mm"]) == pytest.approx(
        start + np.array([0, 10, 0]), abs=0.05
    )


def test_a_closed_stream_of_the_operator_pauses_at_once(driver: ApiClient) -> None:
    stream = driver.stream()
    send(stream, type="heartbeat")
    newest(stream)
    assert driver.state()["safety"]["state"] == "ENABLED"
    began = time.monotonic()
    stream.socket.shutdown(socket.SHUT_RDWR)
    state = driver.until(lambda s: s["safety"]["state"] == "PAUSED", "a dropped stream pauses")
    assert time.monotonic() - began < 0.5
    assert state["safety"]["reason_code"] == "operator_lost"
    assert state["operator"]["name"] == "Ada"


def test_a_watchers_closed_stream_changes_nothing(driver: ApiClient, watcher: ApiClient) -> None:
    with watcher.stream() as stream:
        send(stream, type="heartbeat")
        newest(stream)
    time.sleep(0.3)
    assert driver.state()["safety"]["state"] == "ENABLED"


def test_another_living_stream_of_the_operator_is_enough(driver: ApiClient) -> None:
    with driver.stream() as stays, driver.stream() as goes:
        for _ in range(8):
            send(stays, type="heartbeat")
            goes.close()
            time.sleep(0.1)
        assert driver.state()["safety"]["state"] == "ENABLED"


def test_missing_heartbeats_pause(driver: ApiClient) -> None:
    with driver.stream() as stream:
        for _ in range(6):
            send(stream, type="heartbeat")
            send(stream, type="renew")
            time.sleep(0.25)
        assert driver.state()["safety"]["state"] == "ENABLED"
        began = time.monotonic()
        driver.until(lambda s: s["safety"]["state"] == "PAUSED", "a silent page pauses")
        assert 0.5 * HEARTBEAT_S < time.monotonic() - began < HEARTBEAT_S + 1.0


def test_renewing_over_the_stream_keeps_the_lease(operator: ApiClient) -> None:
    with operator.stream() as stream:
        for _ in range(12):
            send(stream, type="renew")
            time.sleep(0.5)
        assert operator.state()["operator"]["you"] is True


def test_hold_to_move_lasts_while_it_is_repeated(driver: ApiClient) -> None:
    driver.done("PUT", "/teleoperation", {"hold_to_move": True})
    with driver.stream() as stream:
        for _ in range(8):
            send(stream, type="hold", down=True)
            send(stream, type="heartbeat")
            time.sleep(0.25)
            assert driver.state()["hold"] is True
        send(stream, type="hold", down=False)
        driver.until(lambda s: not s["hold"], "released", 0.5)
        send(stream, type="hold", down=True)
        driver.until(lambda s: s["hold"], "pressed", 0.5)
        send(stream, type="heartbeat")
        driver.until(lambda s: not s["hold"], "a press that is not repeated ends", 2.0)


def test_hold_to_move_ends_with_the_stream(driver: ApiClient) -> None:
    driver.done("PUT", "/teleoperation", {"hold_to_move": True})
    with driver.stream() as stream:
        send(stream, type="hold", down=True)
        driver.until(lambda s: s["hold"], "pressed", 0.5)
    driver.until(lambda s: not s["hold"], "the stream is gone", 0.5)


def test_progress_knows_who_is_behind() -> None:
    progress = Progress()
    progress.sent(1, 0.0)
    assert not progress.is_behind(100.0), "a client that tells nothing is not waited for"
    progress.shown(1)
    progress.sent(2, 10.0)
    progress.sent(3, 10.5)
    assert not progress.is_behind(10.9)
    assert progress.is_behind(11.1)
    progress.shown(2)
    assert not progress.is_behind(11.1)
    progress.shown(3)
    assert not progress.is_behind(100.0)


def test_a_client_that_stops_reading_gets_no_backlog(watcher: ApiClient) -> None:
    """After 4 s of 60 states a second unread, the newest state is only a little reading away."""
    with watcher.stream("?rate_hz=60") as stream:
        send(stream, type="heartbeat", tick=newest(stream)["tick"])
        time.sleep(4.0)
        now = watcher.state()["tick"]
        ticks: list[int] = []
        while not ticks or ticks[-1] < now:
            state = newest(stream)
            ticks.append(state["tick"])
            send(stream, type="heartbeat", tick=state["tick"])
    assert len(ticks) <= 70, "at most what is sent in the second that it may be behind"
    assert max(np.diff(ticks)) > 1000, "the states in between were never sent"


def test_a_stuck_client_does_not_hold_up_the_others(watcher: ApiClient) -> None:
    stuck = [watcher.stream("?rate_hz=120") for _ in range(5)]
    time.sleep(3.0)
    with watcher.stream("?rate_hz=30") as stream:
        ages = [newest(stream)["age_ms"] for _ in range(30)]
    for one in stuck:
        one.socket.shutdown(socket.SHUT_RDWR)
    assert np.median(ages) < 20.0
