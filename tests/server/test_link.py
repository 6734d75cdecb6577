"""The link: order, the emergency stop past the queue, and silence that fails closed."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.errors import InvalidPose
from robot.records import RECORD, SETTINGS, LeaderKind, Request
from scenes.path import Path as ScenePath
from scenes.trocar_motion import Breathing
from server.control.mapped_path import MappedPath
from server.memory.control_link import HOLD_TIMEOUT_NS, WEB_TIMEOUT_NS, ControlLink
from server.memory.link import WebLink
from server.memory.link_records import (
    REQUEST_CAPACITY,
    STATUS,
    SUPERVISION,
    SUPERVISION_FILE,
    ControlState,
    Phase,
    TrocarSource,
    create_mapped_files,
)
from server.memory.mapped import MappedReadError, MappedSlot

SECOND_NS = 1_000_000_000


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    create_mapped_files(tmp_path, rate_hz=100.0, ring_seconds=1.0)
    return tmp_path


@pytest.fixture
def control(directory: Path) -> ControlLink:
    return ControlLink(directory)


@pytest.fixture
def web(directory: Path, control: ControlLink) -> WebLink:
    return WebLink(directory)


def poll(control: ControlLink, later_ns: int = 0) -> int:
    control.poll(time.monotonic_ns() + later_ns)
    return control.request


def drag(web: WebLink, sequence: int, clutch: bool = True, **changes: Any) -> None:
    sample: dict[str, Any] = {
        "kind": LeaderKind.GIZMO,
        "position": (0.1, 0.2, 0.3),
        "wxyz": (2.0, 0.0, 0.0, 0.0),
        "absolute": False,
        "smoothing_s": 0.05,
        "timeout_s": 0.12,
    }
    web.leader(sequence=sequence, clutch=clutch, **{**sample, **changes})


def supervise(directory: Path, **fields: Any) -> None:
    slot = MappedSlot(directory / SUPERVISION_FILE, SUPERVISION, writable=True)
    record = np.zeros(1, dtype=SUPERVISION)
    for name, value in fields.items():
        record[name] = value
    slot.write(record)


def test_requests_come_one_a_tick_in_order(web: WebLink, control: ControlLink) -> None:
    numbers = [web.request(Request.ENABLE), web.request(Request.PAUSE)]
    assert poll(control) == Request.ENABLE
    assert control.request_sequence == numbers[0]
    assert poll(control) == Request.PAUSE
    assert control.request_sequence == numbers[1]
    assert poll(control) == Request.NONE


def test_settings_come_with_the_request_that_follows(web: WebLink, control: ControlLink) -> None:
    settings = np.zeros(1, dtype=SETTINGS)
    settings["motion_scale"] = 0.5
    web.settings(settings)
    settings["motion_scale"] = 0.25
    web.settings(settings)
    number = web.request(Request.ENABLE)
    assert poll(control) == Request.ENABLE
    assert control.settings_changed
    assert control.settings["motion_scale"][0] == 0.25
    assert control.request_sequence == number
    poll(control)
    assert not control.settings_changed


def test_the_emergency_stop_passes_everything(web: WebLink, control: ControlLink) -> None:
    for _ in range(50):
        web.request(Request.ENABLE)
    number = web.emergency_stop()
    assert poll(control) == Request.EMERGENCY_STOP
    assert control.request_sequence == number
    assert poll(control) == Request.NONE


def test_an_emergency_stop_keeps_settings(web: WebLink, control: ControlLink) -> None:
    settings = np.zeros(1, dtype=SETTINGS)
    settings["motion_scale"] = 0.5
    web.settings(settings)
    web.emergency_stop()
    poll(control)
    assert control.settings_changed
    assert control.settings["motion_scale"][0] == 0.5


def test_what_comes_after_an_emergency_stop_counts(web: WebLink, control: ControlLink) -> None:
    web.emergency_stop()
    poll(control)
    web.request(Request.RESET)
    assert poll(control) == Request.RESET


def test_a_flood_of_requests_pauses(web: WebLink, control: ControlLink) -> None:
    for _ in range(REQUEST_CAPACITY + 1):
        number = web.request(Request.ENABLE)
    assert poll(control) == Request.PAUSE
    assert control.request_sequence == number


def test_unknown_requests_do_nothing(web: WebLink, control: ControlLink) -> None:
    web.request(13)
    assert poll(control) == Request.NONE


def test_requests_for_an_earlier_control_process_are_void(directory: Path) -> None:
    web = WebLink(directory)
    number = web.request(Request.ENABLE)
    web.emergency_stop()
    control = ControlLink(directory)
    assert poll(control) == Request.NONE
    assert control.request_sequence > number


def test_a_leader_arrives_with_its_age(web: WebLink, control: ControlLink) -> None:
    drag(web, 1)
    poll(control, 50_000_000)
    leader = control.leader[0]
    assert leader["kind"] == LeaderKind.GIZMO
    assert leader["clutch"] == 1
    assert leader["position"].tolist() == [0.1, 0.2, 0.3]
    assert leader["wxyz"].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert 0.05 <= leader["age_s"] < 0.5
    drag(web, 2, clutch=False)
    poll(control)
    assert control.leader["clutch"][0] == 0


def test_a_silent_leader_ages_and_then_no_longer_keeps_others_out(
    web: WebLink, control: ControlLink
) -> None:
    drag(web, 1)
    poll(control, SECOND_NS)
    assert control.leader["clutch"][0] == 1
    poll(control, 3 * SECOND_NS)
    assert control.leader["clutch"][0] == 0
    drag(web, 1, kind=LeaderKind.API_POSE)
    poll(control)
    assert control.leader["kind"][0] == LeaderKind.API_POSE


def test_released_leaders_must_close_anew(web: WebLink, control: ControlLink) -> None:
    drag(web, 1)
    poll(control)
    control.release_leaders()
    drag(web, 2)
    poll(control)
    assert control.leader["clutch"][0] == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"position": (0.0, np.nan, 0.0)},
        {"position": (0.0, np.inf, 0.0)},
        {"wxyz": (0.0, 0.0, 0.0, 0.0)},
        {"wxyz": (np.nan, 0.0, 0.0, 1.0)},
    ],
)
def test_poses_that_are_none_are_refused(
    web: WebLink, control: ControlLink, wrong: dict[str, Any]
) -> None:
    with pytest.raises(InvalidPose):
        drag(web, 1, **wrong)
    poll(control)
    assert control.leader["kind"][0] == LeaderKind.NONE


def test_hold_is_released_when_it_is_not_repeated(web: WebLink, control: ControlLink) -> None:
    web.hold(True)
    poll(control)
    assert control.hold == 1
    poll(control, HOLD_TIMEOUT_NS + 1)
    assert control.hold == 0
    web.hold(True)
    poll(control)
    assert control.hold == 1
    web.hold(False)
    poll(control)
    assert control.hold == 0


def test_a_silent_web_server_is_a_lost_operator_once(web: WebLink, control: ControlLink) -> None:
    assert poll(control, 10 * SECOND_NS) == Request.NONE
    web.alive()
    web.hold(True)
    assert poll(control) == Request.NONE
    assert poll(control, WEB_TIMEOUT_NS + SECOND_NS // 10) == Request.OPERATOR_LOST
    assert control.hold == 0
    assert poll(control, WEB_TIMEOUT_NS + SECOND_NS // 10) == Request.NONE
    web.alive()
    assert poll(control) == Request.NONE


def test_a_dead_web_process_is_a_lost_operator_at_once(
    web: WebLink, control: ControlLink, directory: Path
) -> None:
    supervise(directory, web_pid=1)
    web.alive()
    assert poll(control) == Request.NONE
    supervise(directory, web_pid=0)
    web.request(Request.DISABLE)
    assert poll(control) == Request.DISABLE
    assert poll(control) == Request.OPERATOR_LOST
    assert poll(control) == Request.NONE


def test_opening_the_web_side_anew_opens_every_clutch(directory: Path) -> None:
    control = ControlLink(directory)
    first = WebLink(directory)
    drag(first, 1)
    first.hold(True)
    poll(control)
    assert (control.leader["clutch"][0], control.hold) == (1, 1)
    WebLink(directory)
    poll(control)
    assert (control.leader["clutch"][0], control.hold) == (0, 0)


def rows(count: int) -> NDArray[np.float64]:
    samples = np.zeros((count, 8))
    samples[:, 0], samples[:, 4] = np.arange(count), 1.0
    samples[:, 1] = np.sin(samples[:, 0])
    return samples


def test_a_path_arrives_with_its_number_and_name(
    web: WebLink, control: ControlLink, directory: Path
) -> None:
    for name in ("first", "second", "third"):
        number = web.start_path(rows(5), name, lock_arm=name == "second")
        poll(control)
        assert control.path_start is not None
        file, rows_given, _, locks_arm = control.path_start
        assert locks_arm == (name == "second")
        at, expected = np.empty(7), np.empty(7)
        for time_s in (0.0, 0.7, 3.9, 9.0):
            MappedPath(file, rows_given, name).at(time_s, at)
            ScenePath(rows(5), name).at(time_s, expected)
            assert at.tolist() == expected.tolist()
        assert control.request_sequence == number
        assert web.status()["paths"][control.path_start.path_id] == name
    assert WebLink(directory).status()["paths"] == {1: "first", 2: "second", 3: "third"}
    web.stop_path()
    poll(control)
    assert control.path_stop
    assert control.path_start is None


@pytest.mark.parametrize("wrong", [rows(0), rows(1), rows(3)[:, :7], rows(3) * np.nan, -rows(3)])
def test_paths_that_are_none_are_refused(
    web: WebLink, control: ControlLink, wrong: NDArray[np.float64]
) -> None:
    with pytest.raises(InvalidPose):
        web.start_path(wrong, "wrong")
    poll(control)
    assert control.path_start is None


def test_records_go_to_the_slot_and_the_ring(web: WebLink, control: ControlLink) -> None:
    with pytest.raises(MappedReadError):
        web.snapshot()
    ring = web.ring()
    record = np.zeros(1, dtype=RECORD)
    for tick in range(3):
        record["header"]["tick"] = tick
        control.publish(record)
    assert web.snapshot()["header"]["tick"][0] == 2
    assert ring.read_since(0)[0]["header"]["tick"].tolist() == [0, 1, 2]


def test_what_is_seen_as_the_newest_stands_in_the_ring(
    web: WebLink, control: ControlLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, seen = MappedSlot.write, []

    def note(slot: MappedSlot, record: NDArray[Any]) -> None:
        seen.append(int(web.ring().sequence))
        write(slot, record)

    monkeypatch.setattr(MappedSlot, "write", note)
    before = web.ring().sequence
    control.publish(np.zeros(1, RECORD))
    assert seen == [before + 1]


def test_the_status_tells_starting_running_and_down(
    web: WebLink, control: ControlLink, directory: Path
) -> None:
    assert web.status()["control"] == "starting"
    status = np.zeros(1, dtype=STATUS)
    status["phase"], status["pid"], status["message"] = int(Phase.RUNNING), 11, b"running"
    status["realtime"], status["plant"], status["rate_hz"] = b"SCHED_FIFO", b"kinematic", 500.0
    control.write_status(status)
    supervise(directory, control=int(ControlState.STARTING), control_pid=11)
    told = web.status()
    assert told["control"] == "running"
    assert (told["realtime"], told["plant"], told["rate_hz"]) == ("SCHED_FIFO", "kinematic", 500.0)
    supervise(directory, control=int(ControlState.DOWN), control_pid=0, message=b"it fell")
    told = web.status()
    assert (told["control"], told["message"]) == ("down", "it fell")
    # The next process has not spoken yet: what the last one said does not count for it.
    supervise(directory, control=int(ControlState.STARTING), control_pid=12)
    assert web.status()["control"] == "starting"


def test_a_file_too_short_for_a_path_is_none(web: WebLink, control: ControlLink) -> None:
    web.start_path(rows(5), "cut")
    poll(control)
    assert control.path_start is not None
    with control.path_start.file.open("r+b") as file:
        file.truncate(100)
    with pytest.raises(ValueError, match="size"):
        MappedPath(control.path_start.file, control.path_start.rows, "cut")


def changes(control: ControlLink) -> tuple[Any, Any, Any]:
    """What the next poll brings of trocar, breathing and board."""
    poll(control)
    return control.trocar_change, control.breathing, control.board


def test_changes_of_trocar_and_board_come_one_a_tick(web: WebLink, control: ControlLink) -> None:
    place, breathing = np.array([0.4, -0.01, 0.12]), Breathing(0.005, 3.0)
    web.register_trocar(TrocarSource.ENTER, place)
    web.breathe(breathing)
    number = web.change_board(2)
    trocar, *others = changes(control)
    assert trocar.source == TrocarSource.ENTER
    assert trocar.position.tolist() == place.tolist()
    assert others == [None, None]
    assert changes(control) == (None, breathing, None)
    assert changes(control) == (None, None, 2)
    assert control.request_sequence == number
    assert changes(control) == (None, None, None)


def test_an_emergency_stop_voids_a_trocar_that_was_sent_before(
    web: WebLink, control: ControlLink
) -> None:
    web.register_trocar(TrocarSource.TOUCH, np.zeros(3))
    web.emergency_stop()
    assert poll(control) == Request.EMERGENCY_STOP
    assert control.trocar_change is None
