"""The replay of a recording: what is shown when, and that nothing can be moved."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from robot.records import RECORD
from server.configuration_file import load
from server.memory.link import WebLink
from server.memory.link_records import create_mapped_files
from server.memory.replay_link import ReplayLink, create_replay_files
from server.recording.reader import Recording
from server.recording.replay_process import Replay, Timeline
from server.recording.writer import RecordingWriter
from server.web.stream import Progress
from tests.server.api_client import ApiClient, newest
from tests.server.console_process import ConsoleProcess, eventually
from tests.server.recorded import recorded_run, write

TICK_S = 0.002
SLOW_S = 60.0


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "run.mcap"
    write(path, recorded_run())
    return path


@pytest.fixture
def recording(path: Path) -> Iterator[Recording]:
    with Recording(path) as opened:
        yield opened


class Stage:
    """A replay stepped by hand, and the web side of it."""

    def __init__(self, folder: Path, recording: Recording) -> None:
        create_mapped_files(folder, rate_hz=500.0, ring_seconds=0.1)
        create_replay_files(folder)
        self.replay, self.link = Replay(folder, recording), ReplayLink(folder)
        self.web = WebLink(folder)
        self.now_s = 0.0
        self.step(0.0)

    def step(self, seconds: float) -> None:
        self.now_s += seconds
        self.replay.step(self.now_s)

    @property
    def row(self) -> int:
        """Which record of the run is shown; its stamp is the present time's."""
        shown = self.web.snapshot()
        row = int(shown["header"]["tick"][0]) - 1
        expected = recorded_run()[row : row + 1].copy()
        expected["header"]["stamp_ns"] = shown["header"]["stamp_ns"]
        assert shown.tobytes() == expected.tobytes()
        return row

    @property
    def time_s(self) -> float:
        status = self.link.status()
        assert status is not None
        return status.time_s


@pytest.fixture
def stage(tmp_path: Path, recording: Recording) -> Stage:
    return Stage(tmp_path, recording)


def test_any_time_shows_the_newest_record_until_then(
    recording: Recording, rng: np.random.Generator
) -> None:
    timeline = Timeline(recording)
    assert timeline.duration_s == pytest.approx((len(recorded_run()) - 1) * TICK_S)
    times = rng.uniform(0.0, timeline.duration_s, 200)
    for time_s in (*times, 0.0, timeline.duration_s):
        record = timeline.at(time_s)
        row = int((time_s + 1e-9) / TICK_S)
        assert record.dtype == RECORD
        assert record.tobytes() == recorded_run()[row : row + 1].tobytes()
    assert timeline.at(-1.0).tobytes() == recorded_run()[:1].tobytes()
    assert timeline.at(1e6).tobytes() == recorded_run()[-1:].tobytes()


def test_in_a_gap_the_last_record_before_it_stays(tmp_path: Path) -> None:
    path, records = tmp_path / "gap.mcap", recorded_run()
    with RecordingWriter(path, load()) as writer:
        writer.append(records[:100], 0)
        writer.append(records[300:], 300)
    with Recording(path) as recording:
        timeline = Timeline(recording)
        assert int(timeline.at(200 * TICK_S)["header"]["tick"][0]) == 100
        assert int(timeline.at(300 * TICK_S)["header"]["tick"][0]) == 301


def test_it_stands_at_the_start_until_it_plays(stage: Stage) -> None:
    stage.step(0.5)
    assert (stage.row, stage.time_s) == (0, 0.0)
    stage.link.ask(playing=True)
    stage.step(0.5)
    assert stage.time_s == 0.0
    stage.step(0.1)
    assert stage.time_s == pytest.approx(0.1)
    assert stage.row == 50
    stage.link.ask(speed=2.0)
    stage.step(0.0)
    stage.step(0.2)
    assert stage.time_s == pytest.approx(0.5)
    stage.link.ask(playing=False)
    stage.step(0.0)
    stage.step(3.0)
    assert stage.time_s == pytest.approx(0.5)


def test_it_goes_where_it_is_sent_and_stays_within(stage: Stage) -> None:
    end_s = (len(recorded_run()) - 1) * TICK_S
    for wanted, reached in ((0.8, 0.8), (0.1, 0.1), (1e9, end_s), (0.0, 0.0)):
        stage.link.ask(time_s=wanted)
        stage.step(0.01)
        assert stage.time_s == pytest.approx(reached)
        assert stage.row == int(reached / TICK_S + 1e-6)


def test_it_stops_at_the_end_and_then_plays_from_the_start(stage: Stage) -> None:
    stage.link.ask(time_s=1.0, playing=True)
    stage.step(0.0)
    stage.step(60.0)
    status = stage.link.status()
    assert status is not None
    assert not status.playing
    assert stage.row == len(recorded_run()) - 1
    stage.link.ask(playing=True)
    stage.step(0.0)
    assert stage.row == 0
    stage.step(0.2)
    assert stage.row == 100


def test_a_replay_that_is_started_again_is_where_it_was(
    stage: Stage, tmp_path: Path, recording: Recording
) -> None:
    stage.link.ask(time_s=0.6, speed=0.5)
    stage.step(0.0)
    following = Replay(tmp_path, recording)
    following.step(100.0)
    assert stage.time_s == pytest.approx(0.6)
    assert stage.row == 300


def test_a_client_that_has_shown_a_later_tick_is_not_waited_for_after_a_jump_back() -> None:
    progress = Progress()
    progress.shown(0)
    progress.sent(500, 0.0)
    progress.sent(20, 0.5)
    progress.shown(20)
    assert not progress.is_behind(100.0)
    progress.sent(21, 0.6)
    assert progress.is_behind(100.0)


# A real console that shows the recording


@pytest.fixture(scope="module")
def shown(path: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleProcess]:
    folder = tmp_path_factory.mktemp("shown")
    with ConsoleProcess(folder, command=("replay", str(path))) as running:
        running.wait_until_running()
        yield running


@pytest.fixture
def client(shown: ConsoleProcess) -> Iterator[ApiClient]:
    caller = ApiClient(shown)
    yield caller
    caller.close()


def test_the_state_is_the_recorded_one(client: ApiClient) -> None:
    for time_s in (0.3, 0.9, 0.12):
        told = client.done("PUT", "/replay", {"time_s": time_s, "playing": False})
        assert told["time_s"] == time_s
        state = client.state()
        record = recorded_run()[round(time_s / TICK_S)]
        assert state["replay"] == client.done("GET", "/replay")
        assert state["tick"] == record["header"]["tick"]
        assert state["true"]["position_mm"] == pytest.approx(
            (record["truth"]["position"] * 1e3).tolist(), abs=1e-5
        )
        assert state["control"] == "running"
    assert state["recording"] is False
    assert state["plant"] == load().simulation.plant
    assert client.done("GET", "/configuration") == load().model_dump(mode="json")


def test_the_stream_follows_back_and_forth(client: ApiClient) -> None:
    with client.stream("?rate_hz=60") as stream:
        for time_s in (1.0, 0.2, 0.6, 0.0):
            client.done("PUT", "/replay", {"time_s": time_s, "playing": False})

            def there() -> bool:
                state = newest(stream)
                stream.send(f'{{"type": "heartbeat", "tick": {state["tick"]}}}')
                return bool(state["replay"]["time_s"] == time_s)  # noqa: B023

            eventually(there, f"the stream shows {time_s} s", SLOW_S)


def test_it_plays_by_itself(client: ApiClient) -> None:
    client.done("PUT", "/replay", {"time_s": 0.0, "playing": True, "speed": 1.0})
    client.until(lambda state: state["replay"]["time_s"] > 0.3, "it has gone on", SLOW_S)
    client.until(lambda state: not state["replay"]["playing"], "it ends", SLOW_S)
    assert client.state()["tick"] == len(recorded_run())


@pytest.mark.parametrize(
    ("method", "place", "body"),
    [
        ("POST", "/lease", {"operator": "Ada"}),
        ("POST", "/enable", None),
        ("POST", "/emergency-stop", None),
        ("POST", "/path", {"experiment": "circle"}),
        ("PUT", "/priority", {"case": "1"}),
        ("PUT", "/board", {"name": "none"}),
        ("POST", "/recording", None),
    ],
)
def test_what_would_go_to_a_robot_is_refused(
    client: ApiClient, method: str, place: str, body: object
) -> None:
    before = client.done("PUT", "/replay", {"time_s": 0.4, "playing": False})
    problem = client.refused(method, place, body)
    assert (problem["status"], problem["code"]) == (409, "only_a_replay")
    assert client.done("GET", "/replay") == before


def test_orders_on_the_stream_lead_nowhere(client: ApiClient) -> None:
    client.done("PUT", "/replay", {"time_s": 0.4, "playing": False})
    with client.stream() as stream:
        stream.send('{"type": "renew"}')
        assert newest(stream, "problem")["problem"]["code"] == "not_the_operator"
        stream.send('{"type": "emergency-stop"}')
        for _ in range(10):
            assert newest(stream)["tick"] == 201


def test_times_and_speeds_that_are_none_are_refused(client: ApiClient) -> None:
    for body in ({"time_s": -1.0}, {"speed": 0.0}, {"speed": 11.0}, {"playing": 1}, {"to": 1}):
        assert client.refused("PUT", "/replay", body)["status"] == 422


def test_where_there_is_a_robot_there_is_no_replay(watcher: ApiClient) -> None:
    assert watcher.state()["replay"] is None
    for method in ("GET", "PUT"):
        problem = watcher.refused(method, "/replay", {} if method == "PUT" else None)
        assert (problem["status"], problem["code"]) == (404, "no_replay")
