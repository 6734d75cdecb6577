"""The concentric-tube arms in the same console: API, paths, stream, recording, replay, faults."""

from __future__ import annotations

import gc
import json
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher
from pydantic import TypeAdapter

from hardware.tube_plant import TubePlant
from robot.concentric.concentric_robot import ConcentricRobot
from robot.concentric.design import METHODS
from robot.records import Request, Safety
from scenes.experiments.tube_playing import played
from server.control.concentric_loop import ConcentricLoop
from server.control.warm_up import warm_up_tubes
from server.recording.reader import Recording
from server.recording.verify import verify
from server.recording.writer import RecordingWriter
from server.web.concentric_message import ConcentricMessages
from server.web.state_message import OperatorView, Surroundings
from server.web.state_schema import ConcentricState
from tests.configured import LATE_LEADERS, LATE_TICKS, configured
from tests.robot.concentric.tube_drive import concentric
from tests.server.api_client import ApiClient, newest
from tests.server.console_process import ConsoleProcess, eventually


def run(method: str, seconds: float) -> tuple[ConcentricLoop, list[np.ndarray]]:
    """A loop that plays the rectangle for so long, and its records."""
    configuration = concentric(method=method)
    robot = ConcentricRobot(configuration)
    plant = TubePlant(configuration, robot.initial_state()["q"][0])
    loop = ConcentricLoop(robot, plant, configuration)
    records = []
    loop.step()
    records.append(loop.record.copy())
    loop.request = Request.ENABLE
    loop.step()
    records.append(loop.record.copy())
    loop.start_path(played("rectangle"))
    for _ in range(round(seconds * configuration.concentric.rate_hz)):
        loop.step()
        records.append(loop.record.copy())
    return loop, records


@pytest.fixture(scope="module")
def recorded() -> list[np.ndarray]:
    return run("hqp", 6.0)[1]


def test_a_path_is_followed_and_b_stays_beside_a(recorded: list[np.ndarray]) -> None:
    records = np.concatenate(recorded)
    assert (records["outcome"]["state"]["safety"][2:] == Safety.ENABLED).all()
    travelled = np.linalg.norm(records["truth"]["position"][-1] - records["truth"]["position"][0])
    assert travelled > 0.005
    # Against the truth: motors lag by 20 ms.
    assert 1e3 * records["truth"]["relative_error"].max() < 0.05
    assert 1e3 * records["truth"]["position_error"].max() < 0.5
    assert 1e3 * records["outcome"]["report"]["relative_error"].max() < 0.02


def test_a_recording_comes_out_the_same_bit_for_bit(
    recorded: list[np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "tubes.mcap"
    with RecordingWriter(path, concentric(method="hqp")) as writer:
        for record in recorded:
            writer.append(record)
    with Recording(path) as recording:
        assert recording.metadata["robot"] == "concentric"
        assert recording.types.robot == "concentric"
        result = verify(recording)
    assert result.checked == len(recorded) - 1
    assert result.differing == 0
    assert not result.restarts


def test_every_field_of_the_message_is_there_and_no_other(recorded: list[np.ndarray]) -> None:
    messages = ConcentricMessages(concentric())
    around = Surroundings(now_ns=0, control="running", plant="tubes")
    for record in (None, recorded[0], recorded[-1]):
        message = messages.message(record, around, OperatorView())
        TypeAdapter(ConcentricState).validate_python(message)


def test_bounds_hold_the_translations_that_are_told(recorded: list[np.ndarray]) -> None:
    messages = ConcentricMessages(concentric())
    around = Surroundings(now_ns=0, control="running")
    for record in recorded[::50]:
        message = messages.message(record, around, OperatorView())
        for arm in message["arms"]:
            bounds = zip(arm["lower_mm"], arm["translations_mm"], arm["upper_mm"], strict=True)
            assert all(low - 1e-6 <= value <= high + 1e-6 for low, value, high in bounds)


def test_nothing_compiles_once_real_time_has_begun() -> None:
    configuration = concentric()
    robot = ConcentricRobot(configuration)
    warm_up_tubes(robot)
    plant = TubePlant(configuration, robot.initial_state()["q"][0])
    loop = ConcentricLoop(robot, plant, configuration)
    loop.step()
    functions = [one for one in gc.get_objects() if isinstance(one, Dispatcher)]
    before = [len(function.signatures) for function in functions]
    loop.request = Request.ENABLE
    loop.step()
    loop.start_path(played("lissajous"))
    for tick in range(200):
        loop.settings["method"] = tick % len(METHODS)
        loop.step()
    assert [len(function.signatures) for function in functions] == before


@pytest.fixture(scope="module")
def tubes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleProcess]:
    """A console that drives the concentric-tube arms."""
    folder = tmp_path_factory.mktemp("tubes")
    arguments = ("--robot", "concentric", *configured(folder, LATE_TICKS, LATE_LEADERS))
    with ConsoleProcess(folder, *arguments, robot="concentric") as running:
        running.wait_until_running()
        yield running


@pytest.fixture
def driver(tubes: ConsoleProcess) -> Iterator[ApiClient]:
    """Holds the lease of enabled arms."""
    client = ApiClient(tubes)
    client.take()
    client.done("POST", "/enable")
    yield client
    client.take_when_free()
    client.call("POST", "/reset")
    client.call("POST", "/disable")
    client.done("DELETE", "/lease")
    client.close()


def test_the_console_says_which_robots_there_are_and_which_is_driven(driver: ApiClient) -> None:
    found = driver.http.get(driver.console.base + "/api/v1/robots").json()
    assert {one["name"]: one["selected"] for one in found} == {
        "instrument": False, "concentric": True,
    }  # fmt: skip
    other = driver.http.get(driver.console.base + "/api/v1/robots/instrument/state")
    assert other.status_code == 409
    assert other.json()["code"] == "robot_not_selected"
    unknown = driver.http.get(driver.console.base + "/api/v1/robots/hexapod/state")
    assert unknown.status_code == 404


def test_a_goes_to_a_target_and_the_loop_keeps_its_time(driver: ApiClient) -> None:
    before = driver.state()
    goal = [value + 1.5 for value in before["true"]["position_mm"]]
    driver.done("POST", "/target", {"position_mm": goal})

    def arrived(state: dict[str, Any]) -> bool:
        there = np.array(state["true"]["position_mm"])
        return bool(np.linalg.norm(there - goal) < 0.05)

    state = driver.until(arrived, "A is at its target")
    assert state["errors"]["relative_mm"] < 0.05
    assert state["loop"]["rate_hz"] == pytest.approx(100.0, rel=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_can_be_chosen(driver: ApiClient, method: str) -> None:
    assert driver.done("PUT", "/method", {"method": method})["method"] == method
    problem = driver.refused("PUT", "/method", {"method": f"{method}?"})
    assert problem["code"] == "invalid_request"
    driver.done("PUT", "/method", {"method": "hqp"})


def test_what_only_the_instrument_has_is_not_there(driver: ApiClient) -> None:
    for method, path in (("PUT", "/priority"), ("POST", "/trocar"), ("PUT", "/board")):
        assert driver.call(method, path, {}).status_code in (404, 405)


def test_a_path_plays_and_is_recorded(driver: ApiClient, tubes: ConsoleProcess) -> None:
    names = [one["name"] for one in driver.http.get("/experiments").json()]
    assert names == ["rectangle", "lissajous"]
    driver.done("POST", "/recording", {"name": "tubes"})
    driver.done("POST", "/path", {"experiment": "rectangle"})
    driver.until(lambda state: (state["path"] or {}).get("progress", 0) > 0.03, "it plays")
    driver.done("DELETE", "/path")
    driver.done("DELETE", "/recording")
    path = tubes.recordings / "tubes.mcap"
    eventually(path.exists, "the file is there")
    with Recording(path) as recording:
        result = verify(recording)
    assert result.checked > 100
    assert result.differing == 0


def test_a_clutched_leader_over_the_stream_moves_a(driver: ApiClient) -> None:
    start = np.array(driver.state()["true"]["position_mm"])
    with driver.stream("?rate_hz=20") as stream:
        for step in range(60):
            sample = {
                "type": "leader",
                "position_mm": [0.02 * step, 0.0, 0.0],
                "orientation_wxyz": [1.0, 0.0, 0.0, 0.0],
                "clutch": step < 59,
            }
            stream.send(json.dumps(sample))
            stream.send('{"type":"heartbeat"}')
            time.sleep(0.01)
        state = newest(stream)
    assert state["robot"] == "concentric"
    there = np.array(driver.state()["true"]["position_mm"])
    assert there[0] - start[0] > 0.2


def test_faults_of_tubes_can_be_injected(driver: ApiClient) -> None:
    names = {one["name"] for one in driver.http.get("/faults").json()}
    assert "tube-stuck" in names
    assert "servo-silent" not in names
    driver.done("POST", "/faults", {"name": "encoder-jump"})
    state = driver.until(lambda state: state["safety"]["state"] == "FAULT", "it is noticed")
    assert state["safety"]["reason_code"] == "tracking_error"
    driver.done("DELETE", "/faults")


def test_another_robot_is_driven_only_after_disabling(driver: ApiClient) -> None:
    select = driver.console.base + "/api/v1/robots/instrument/select"
    answer = driver.http.post(select)
    assert answer.status_code == 409
    assert "disable it first" in answer.json()["detail"]
    assert driver.http.post(select.replace("instrument", "hexapod")).status_code == 422
    same = driver.http.post(select.replace("instrument", "concentric"))
    assert same.status_code == 202
    time.sleep(0.6)
    assert driver.state()["safety"]["state"] == "ENABLED"


def _changed(console: ConsoleProcess, before: tuple[int, int]) -> bool:
    return console.children() != before


def test_the_other_robot_starts_disabled_and_back(tubes: ConsoleProcess) -> None:
    client = ApiClient(tubes)
    client.take()
    for robot in ("instrument", "concentric"):
        before = tubes.children()
        select = f"{tubes.base}/api/v1/robots/{robot}/select"
        assert client.http.post(select).status_code == 202
        eventually(partial(_changed, tubes, before), "processes start anew")
        tubes.robot_path = f"/api/v1/robots/{robot}"
        state = tubes.wait_until_running()
        assert state["robot"] == robot
        assert state["safety"]["state"] == "DISABLED"
        assert state["operator"]["name"] is None
        client.close()
        client = ApiClient(tubes)
        client.take()
    client.done("DELETE", "/lease")
    client.close()
    events = "".join(path.read_text() for path in tubes.audit.glob("*.jsonl"))
    assert events.count('"robot_selected"') == 2
