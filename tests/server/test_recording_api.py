"""Recording a real console: by the API, from the start, and what stands in the files."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from server.memory.recording_link import RecordingLink
from server.recording.reader import Recording
from server.recording.verify import verify
from tests.server.api_client import ApiClient
from tests.server.console_process import ConsoleProcess, eventually

SLOW_S = 60.0


@pytest.fixture
def recordist(console: ConsoleProcess, watcher: ApiClient) -> ApiClient:
    """Has the token and no lease; no recording is being made."""
    watcher.done("DELETE", "/recording")
    return watcher


def test_a_recording_is_made_and_verifies(
    console: ConsoleProcess, operator: ApiClient, recordist: ApiClient
) -> None:
    told = recordist.done("POST", "/recording", {"name": "by the API"})
    path = console.recordings / "by the API.mcap"
    assert told["recording"]
    assert told["file"] == str(path)
    recordist.until(lambda state: state["recording"], "the state says so")
    operator.done("POST", "/enable")
    operator.done("POST", "/path", {"experiment": "circle"})
    eventually(lambda: recordist.done("GET", "/recording")["duration_s"] > 2.0, "2 s", SLOW_S)
    operator.done("POST", "/disable")
    again = recordist.refused("POST", "/recording")
    assert (again["status"], again["code"]) == (409, "already_recording")
    ended = recordist.done("DELETE", "/recording")
    assert not ended["recording"]
    assert ended["gaps"] == ended["lost_ticks"] == 0
    assert ended["problem"] is None
    recordist.until(lambda state: not state["recording"], "the state says so")
    with Recording(path) as recording:
        assert not recording.cut
        result = verify(recording)
        assert recording.duration_s == pytest.approx(ended["duration_s"], abs=1e-3)
    assert result.differing == 0
    assert result.restarts == []
    assert result.checked == ended["ticks"] - 1
    assert path.stat().st_size * 1e-6 == pytest.approx(ended["size_mb"], abs=0.01)
    listed = recordist.call("GET", "/recordings").json()
    assert [path.name, ended["size_mb"]] in [[one["name"], one["size_mb"]] for one in listed]


def test_names_that_are_none_or_taken_are_refused(
    console: ConsoleProcess, recordist: ApiClient
) -> None:
    for name in ("../up", "a/b", ".hidden", ""):
        assert recordist.refused("POST", "/recording", {"name": name})["status"] == 422
    console.recordings.mkdir(parents=True, exist_ok=True)
    (console.recordings / "taken.mcap").write_text("mine")
    problem = recordist.call("POST", "/recording", {"name": "taken"}).json()
    assert problem["code"] == "recording_failed"
    assert "exists already" in problem["detail"]
    assert (console.recordings / "taken.mcap").read_text() == "mine"
    assert "exists already" in recordist.done("GET", "/recording")["problem"]
    assert not recordist.state()["recording"]


def test_a_killed_recorder_comes_back_and_goes_on(
    console: ConsoleProcess, recordist: ApiClient
) -> None:
    first = Path(recordist.done("POST", "/recording", {"name": "killed"})["file"])
    eventually(lambda: recordist.done("GET", "/recording")["ticks"] > 200, "it records", SLOW_S)
    link = RecordingLink(console.directory)
    pid = link.status().pid
    link.close()
    os.kill(pid, signal.SIGKILL)
    second = console.recordings / "killed-2.mcap"
    eventually(
        lambda: recordist.done("GET", "/recording")["file"] == str(second), "it is back", SLOW_S
    )
    eventually(lambda: recordist.done("GET", "/recording")["ticks"] > 200, "it goes on", SLOW_S)
    assert "started again" in recordist.done("GET", "/recording")["problem"]
    recordist.done("DELETE", "/recording")
    with Recording(first) as one, Recording(second) as other:
        before, after = list(one.batches())[-1], next(other.batches())
        assert one.cut
        assert not other.cut
        assert int(after.sequence[0]) == int(before.sequence[-1]) + 1


def test_without_a_name_it_is_named_by_the_time(
    console: ConsoleProcess, recordist: ApiClient
) -> None:
    path = Path(recordist.done("POST", "/recording")["file"])
    eventually(lambda: recordist.done("GET", "/recording")["ticks"] > 0, "it records", SLOW_S)
    recordist.done("DELETE", "/recording")
    assert path.parent == console.recordings
    with Recording(path) as recording:
        assert recording.metadata["plant"] == "kinematic"
        assert recording.configuration() == console_configuration(recordist, recording)


def console_configuration(client: ApiClient, recording: Recording) -> object:
    """The console's configuration, read by the class of the recording's."""
    return type(recording.configuration()).model_validate(client.done("GET", "/configuration"))
