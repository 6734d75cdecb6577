"""The API as a program uses it, on the real control process."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import numpy as np
import pytest

from robot.records import RECORD, Safety
from robot.safety import TRANSITIONS
from scenes import experiments
from server.memory.link_records import RECORD_RING_FILE
from server.memory.mapped import MappedRing
from server.web.state_schema import StateMessage
from tests.server.api_client import JSON, ApiClient
from tests.server.console_process import ConsoleProcess

CSV = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,0,0,-5,1,0,0,0\n"
IDENTITY = [1.0, 0.0, 0.0, 0.0]
POSE = {"position_mm": [509.0, 0.0, -1.0], "orientation_wxyz": IDENTITY}
LEADER = {**POSE, "clutch": True}


def tip(state: JSON) -> np.ndarray:
    return np.array(state["true"]["position_mm"])


def beside(state: JSON, x: float, y: float, z: float) -> list[float]:
    """A position so many mm from the tip."""
    found: list[float] = (tip(state) + np.array([x, y, z])).tolist()
    return found


def test_the_state_has_every_field(watcher: ApiClient) -> None:
    state = watcher.state()
    StateMessage.model_validate(state)
    assert state["control"] == "running"
    assert state["age_ms"] < 100.0


def test_a_target_is_reached_with_small_errors(driver: ApiClient) -> None:
    before = driver.state()
    goal = beside(before, 0.0, 4.0, -6.0)
    answer = driver.done("POST", "/target", {"position_mm": goal})
    assert answer["leader"] == "api_target"
    after = driver.until(lambda s: not s["engaged"], "the target is let go when it is reached")
    assert tip(after) == pytest.approx(goal, abs=0.01)
    assert after["errors"]["position_mm"] <= 0.01
    assert after["errors"]["orientation_deg"] <= 0.01
    assert after["errors"]["rcm_mm"] <= 0.001
    assert after["safety"]["state"] == "ENABLED"


def test_a_target_may_turn_the_tip(driver: ApiClient) -> None:
    before = driver.state()
    w, x, y, z = before["true"]["orientation_wxyz"]
    half = math.radians(10.0) / 2
    turned = [
        w * math.cos(half) - z * math.sin(half), x * math.cos(half) + y * math.sin(half),
        y * math.cos(half) - x * math.sin(half), z * math.cos(half) + w * math.sin(half),
    ]  # fmt: skip
    goal = {"position_mm": before["true"]["position_mm"], "orientation_wxyz": turned}
    driver.done("POST", "/target", goal)
    after = driver.until(lambda s: not s["engaged"], "the target is reached")
    assert abs(np.dot(after["true"]["orientation_wxyz"], turned)) == pytest.approx(1.0, abs=1e-6)


def test_a_newer_target_takes_the_place_of_the_older(driver: ApiClient) -> None:
    start = driver.state()
    driver.done("POST", "/target", {"position_mm": beside(start, 0, 20, 0)})
    goal = beside(start, 0, -3, 0)
    driver.done("POST", "/target", {"position_mm": goal})
    after = driver.until(lambda s: not s["engaged"], "the newer target is reached")
    assert tip(after) == pytest.approx(goal, abs=0.01)


def test_a_clutched_leader_moves_the_tip_by_its_own_motion(driver: ApiClient) -> None:
    driver.done("PUT", "/teleoperation", {"motion_scale": 0.5})
    start = tip(driver.state())
    for step in range(101):
        pose = {"position_mm": [1000.0, 0.1 * step, 0.0], "orientation_wxyz": IDENTITY}
        driver.done("POST", "/leader", {**pose, "clutch": True})
        if step == 0:
            # Samples may follow each other faster than ticks: the anchor must be this one.
            driver.until(lambda s: s["engaged"], "it leads")
    moved = driver.until(
        lambda s: (
            driver.call("POST", "/leader", {**pose, "clutch": True}).is_success
            and abs(tip(s)[1] - start[1] - 5.0) < 0.01
        ),
        "half of the leader's 10 mm",
    )
    driver.done("POST", "/leader", {**pose, "clutch": False})
    assert moved["leader"] == "api_pose"
    assert driver.until(lambda s: not s["engaged"], "let go")["safety"]["state"] == "ENABLED"


def test_a_silent_leader_pauses(driver: ApiClient) -> None:
    driver.done(
        "POST", "/leader", {"position_mm": [0, 0, 0], "orientation_wxyz": IDENTITY, "clutch": True}
    )
    state = driver.until(lambda s: s["safety"]["state"] == "PAUSED", "a stale leader pauses")
    assert state["safety"]["reason_code"] == "leader_stale"


def test_leader_motion_can_follow_the_view(driver: ApiClient) -> None:
    quarter_about_z = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
    driver.done("PUT", "/teleoperation", {"view_wxyz": quarter_about_z})
    start = tip(driver.state())
    for step in range(51):
        pose = {"position_mm": [0.1 * step, 0.0, 0.0], "orientation_wxyz": IDENTITY}
        driver.done("POST", "/leader", {**pose, "clutch": True})
    driver.until(
        lambda s: (
            driver.call("POST", "/leader", {**pose, "clutch": True}).is_success
            and np.abs(tip(s) - start - [0.0, 5.0, 0.0]).max() < 0.01
        ),
        "5 mm along the view's x are 5 mm along the base's y",
    )
    driver.done("POST", "/leader", {**pose, "clutch": False})


@pytest.mark.parametrize("case", ["0", "1", "2", "pointing"])
def test_the_priority_can_be_chosen(operator: ApiClient, case: str) -> None:
    state = operator.done("PUT", "/priority", {"case": case})
    assert state["priority"] == {"case": case, "solver": "hqp", "coordinates": "uv"}


def test_settings_left_out_stay_as_they_are(operator: ApiClient) -> None:
    operator.done("PUT", "/priority", {"solver": "closed-form", "coordinates": "polar"})
    operator.done("PUT", "/teleoperation", {"motion_scale": 0.25, "lock_rotation": True})
    state = operator.done("PUT", "/teleoperation", {"alignment": "matched"})
    assert state["priority"] == {"case": "1", "solver": "closed-form", "coordinates": "polar"}
    assert state["teleoperation"]["motion_scale"] == 0.25
    assert state["teleoperation"]["lock_rotation"] is True
    assert state["teleoperation"]["alignment"] == "matched"


def test_settings_sent_at_once_do_not_undo_each_other(operator: ApiClient) -> None:
    changes: list[JSON] = [
        {"motion_scale": 0.5},
        {"lock_rotation": True},
        {"lock_translation": True},
    ]
    threads = [
        threading.Thread(target=operator.done, args=("PUT", "/teleoperation", change))
        for change in changes
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = operator.state()["teleoperation"]
    assert all(found[name] == value for change in changes for name, value in change.items())


def test_an_experiment_plays_and_stops(driver: ApiClient) -> None:
    listed = {one["name"]: one for one in driver.call("GET", "/experiments").json()}
    assert list(listed) == list(experiments.names())
    assert listed["ring-board"]["board"] == "ring-board"
    assert len(listed["ring-board"]["marks_s"]) >= 6
    assert (listed["circle"]["board"], listed["circle"]["arm_locked"]) == (None, False)
    assert (listed["arc"]["board"], listed["arc"]["arm_locked"]) == ("none", True)
    state = driver.done("POST", "/path", {"experiment": "circle"})
    assert state["path"]["name"] == "circle"
    playing = driver.until(lambda s: s["path"]["progress"] > 0.02, "the path goes on")
    assert playing["leader"] == "path"
    assert playing["errors"]["position_mm"] <= 0.01
    stopped = driver.done("DELETE", "/path")
    assert stopped["path"] is None
    assert driver.until(lambda s: not s["engaged"], "at rest")["safety"]["state"] == "ENABLED"


def test_the_arm_stands_still_while_the_arc_plays(operator: ApiClient) -> None:
    before = operator.state()
    operator.done("PUT", "/board", {"name": "pegboard"})
    operator.done("POST", "/enable")
    refusal = operator.refused("POST", "/path", {"experiment": "arc"})
    assert (refusal["code"], refusal["needed"]) == ("board_needed", "none")
    operator.done("POST", "/disable")
    operator.done("PUT", "/board", {"name": "none"})
    operator.done("POST", "/enable")
    operator.done("POST", "/path", {"experiment": "arc"})
    bent = operator.until(lambda s: s["path"]["progress"] > 0.15, "the segment moves")
    assert bent["joints_deg"] == pytest.approx(before["joints_deg"], abs=1e-6)
    assert abs(bent["bend_deg"] - before["bend_deg"]) > 1.0
    operator.done("DELETE", "/path")
    operator.done("POST", "/disable")
    operator.done("PUT", "/board", {"name": before["board"]})


def test_a_path_from_csv_plays_to_its_end(driver: ApiClient) -> None:
    start = driver.state()
    driver.done("POST", "/path", {"csv": CSV, "name": "down.csv"})
    refusal = driver.refused("POST", "/path", {"experiment": "circle"})
    assert refusal["code"] == "not_ready"
    assert "playing" in refusal["detail"]
    assert (
        driver.refused("POST", "/target", {"position_mm": beside(start, 0, 0, 0)})["code"]
        == "not_ready"
    )
    after = driver.until(lambda s: s["path"] is None, "the path ends")
    assert tip(after) == pytest.approx(beside(start, 0, 0, -5), abs=0.01)


def test_what_can_be_read_is_read(watcher: ApiClient) -> None:
    configuration = watcher.done("GET", "/configuration")
    assert configuration["instrument"]["segment_length_m"] == 0.03
    rows = watcher.call("GET", "/transitions").json()
    assert len(rows) == len(TRANSITIONS)
    stop = next(r for r in rows if r["state"] == "ENABLED" and r["event"] == "EMERGENCY_STOP")
    assert (stop["next"], stop["request"]) == ("FAULT", True)
    robots = watcher.http.get(watcher.console.base + "/api/v1/robots").json()
    assert [one["name"] for one in robots if one["selected"]] == ["instrument"]
    assert {one["name"] for one in robots} == {"instrument", "concentric"}


def test_dexterity_is_computed_where_the_tip_is(watcher: ApiClient) -> None:
    found = watcher.done("GET", "/dexterity")
    assert found


def test_the_emergency_stop_is_for_everyone_and_holds(
    driver: ApiClient, watcher: ApiClient
) -> None:
    driver.done("POST", "/path", {"experiment": "circle"})
    driver.until(lambda s: s["path"]["progress"] > 0.005, "the path goes on")
    state = watcher.done("POST", "/emergency-stop")
    assert state["safety"]["state"] == "FAULT"
    assert state["safety"]["reason_code"] == "emergency_stop"
    held = tip(watcher.state())
    refusal = driver.refused("POST", "/enable")
    assert (refusal["status"], refusal["code"]) == (409, "request_refused")
    assert "reset" in refusal["detail"]
    time.sleep(0.1)
    assert tip(watcher.state()) == pytest.approx(held, abs=1e-9)
    assert driver.done("POST", "/reset")["safety"]["state"] == "DISABLED"


def test_the_emergency_stop_acts_within_two_ticks(
    driver: ApiClient, console: ConsoleProcess
) -> None:
    ring = MappedRing(console.directory / RECORD_RING_FILE, RECORD)
    driver.done("POST", "/target", {"position_mm": beside(driver.state(), 0, 40, 0)})
    first = ring.sequence
    driver.done("POST", "/emergency-stop")
    records, _, lost = ring.read_since(first)
    ring.close()
    assert not lost
    states = records["outcome"]["state"]["safety"]
    moving = records["outcome"]["command"]["moving"]
    assert Safety.FAULT in states
    assert not moving[states == Safety.FAULT].any()


def test_anyone_may_pause(driver: ApiClient, watcher: ApiClient) -> None:
    assert watcher.done("POST", "/pause")["safety"]["state"] == "PAUSED"
    assert driver.done("POST", "/enable")["safety"]["state"] == "ENABLED"
    assert driver.done("POST", "/disable")["safety"]["state"] == "DISABLED"


def test_what_the_table_does_not_list_is_refused_with_the_reason(operator: ApiClient) -> None:
    for path in ("/pause", "/reset"):
        refusal = operator.refused("POST", path)
        assert (refusal["status"], refusal["code"]) == (409, "request_refused")
        assert refusal["state"] == "DISABLED"
    assert operator.state()["safety"]["state"] == "DISABLED"


ONLY_FOR_THE_OPERATOR: list[tuple[str, str, Any]] = [
    ("POST", "/enable", None),
    ("POST", "/disable", None),
    ("POST", "/reset", None),
    ("PUT", "/priority", {"case": "2"}),
    ("PUT", "/teleoperation", {"motion_scale": 0.5}),
    ("POST", "/target", {"position_mm": [500, 0, 0]}),
    ("POST", "/leader", {"position_mm": [0, 0, 0], "orientation_wxyz": IDENTITY, "clutch": True}),
    ("POST", "/path", {"experiment": "circle"}),
    ("DELETE", "/path", None),
    ("POST", "/lease/renew", None),
    ("POST", "/lease/hand-over", {"to": "Eve"}),
    ("DELETE", "/lease", None),
]


@pytest.mark.parametrize(("method", "path", "body"), ONLY_FOR_THE_OPERATOR)
def test_a_watcher_moves_nothing(
    driver: ApiClient, watcher: ApiClient, method: str, path: str, body: Any
) -> None:
    before = driver.state()
    refusal = watcher.refused(method, path, body)
    assert (refusal["status"], refusal["code"]) == (403, "not_the_operator")
    assert refusal["operator"] == "Ada"
    after = driver.state()
    assert after["true"] == before["true"]
    assert after["teleoperation"] == before["teleoperation"]
    assert after["priority"] == before["priority"]
    assert after["safety"] == before["safety"]


def test_a_second_operator_waits_for_the_hand_over(driver: ApiClient, watcher: ApiClient) -> None:
    refusal = watcher.refused("POST", "/lease", {"operator": "Grace"})
    assert (refusal["status"], refusal["code"], refusal["operator"]) == (409, "lease_held", "Ada")
    assert watcher.state()["operator"]["name"] == "Ada"
    assert watcher.state()["operator"]["you"] is False
    assert driver.state()["operator"]["you"] is True
    driver.done("POST", "/lease/hand-over", {"to": "Grace"})
    assert watcher.refused("POST", "/lease", {"operator": "Mallory"})["offered_to"] == "Grace"
    watcher.take("Grace")
    state = watcher.until(lambda s: s["safety"]["state"] == "PAUSED", "a hand-over pauses")
    assert state["operator"] == {**state["operator"], "name": "Grace", "you": True}
    assert driver.refused("POST", "/enable")["operator"] == "Grace"
    watcher.done("DELETE", "/lease")


def test_a_released_lease_pauses(driver: ApiClient) -> None:
    driver.done("DELETE", "/lease")
    driver.forget_lease()
    state = driver.until(lambda s: s["safety"]["state"] == "PAUSED", "a release pauses")
    assert state["safety"]["reason_code"] == "operator_lost"
    assert set(state["operator"].values()) == {None, False}


def test_an_expired_lease_pauses_and_stops_the_path(driver: ApiClient, watcher: ApiClient) -> None:
    driver.done("POST", "/path", {"experiment": "circle"})
    began = time.monotonic()
    state = watcher.until(lambda s: s["safety"]["state"] == "PAUSED", "expiry pauses", 8.0)
    assert 4.0 < time.monotonic() - began < 6.0
    assert state["operator"]["name"] is None
    watcher.until(lambda s: s["path"] is None, "the path does not go on for the next operator")
    assert driver.refused("POST", "/enable")["code"] == "not_the_operator"


NAN, INFINITY = math.nan, math.inf
BAD: list[tuple[str, str, Any, int]] = [
    ("POST", "/target", {"position_mm": [NAN, 0, 0]}, 422),
    ("POST", "/target", {"position_mm": [INFINITY, 0, 0]}, 422),
    ("POST", "/target", {"position_mm": [1e300, 0, 0]}, 422),
    ("POST", "/target", {"position_mm": [0, 0]}, 422),
    ("POST", "/target", {"position_mm": ["500", 0, 0]}, 422),
    ("POST", "/target", {"position_mm": [True, 0, 0]}, 422),
    ("POST", "/target", {"position_mm": None}, 422),
    ("POST", "/target", {}, 422),
    ("POST", "/target", [], 422),
    ("POST", "/target", {**POSE, "orientation_wxyz": [0, 0, 0, 0]}, 422),
    ("POST", "/target", {**POSE, "orientation_wxyz": [NAN, 0, 0, 1]}, 422),
    ("POST", "/target", {**POSE, "speed": 3}, 422),
    ("POST", "/target", {"position_mm": [900.0, 0.0, 0.0]}, 422),
    ("POST", "/leader", {**LEADER, "position_mm": [0, -INFINITY, 0]}, 422),
    ("POST", "/leader", {**LEADER, "orientation_wxyz": [0, 0, 0, 0]}, 422),
    ("POST", "/leader", {**LEADER, "orientation_wxyz": [1e-9, 0, 0, 0]}, 422),
    ("POST", "/leader", {**LEADER, "clutch": "yes"}, 422),
    ("POST", "/leader", POSE, 422),
    ("PUT", "/teleoperation", {"motion_scale": 0}, 422),
    ("PUT", "/teleoperation", {"motion_scale": -1.0}, 422),
    ("PUT", "/teleoperation", {"motion_scale": NAN}, 422),
    ("PUT", "/teleoperation", {"motion_scale": INFINITY}, 422),
    ("PUT", "/teleoperation", {"motion_scale": 0.01}, 422),
    ("PUT", "/teleoperation", {"motion_scale": 2.01}, 422),
    ("PUT", "/teleoperation", {"motion_scale": "1"}, 422),
    ("PUT", "/teleoperation", {"alignment": "sideways"}, 422),
    ("PUT", "/teleoperation", {"lock_rotation": 1}, 422),
    ("PUT", "/teleoperation", {"view_wxyz": [0, 0, 0, 0]}, 422),
    ("PUT", "/priority", {"case": "3"}, 422),
    ("PUT", "/priority", {"case": 1}, 422),
    ("PUT", "/priority", {"case": "1", "solver": "magic"}, 422),
    ("PUT", "/priority", {"case": "1", "coordinates": "xy"}, 422),
    ("POST", "/path", {"experiment": "loop-the-loop"}, 404),
    ("POST", "/path", {"experiment": "x" * 81}, 422),
    ("POST", "/path", {"experiment": "circle", "csv": CSV}, 422),
    ("POST", "/path", {}, 422),
    ("POST", "/path", {"csv": ""}, 422),
    ("POST", "/path", {"csv": CSV.replace("x_mm", "x_m")}, 422),
    ("POST", "/path", {"csv": CSV.replace("-5", "nan")}, 422),
    ("POST", "/path", {"csv": CSV.replace("1,0,0,-5,1,0,0,0", "1,0,0,-5,0,0,0,0")}, 422),
    ("POST", "/path", {"csv": CSV.replace("1,0,0,-5", "0,0,0,-5")}, 422),
    ("POST", "/lease", {"operator": ""}, 422),
    ("POST", "/lease", {"operator": "   "}, 422),
    ("POST", "/lease", {"operator": "x" * 41}, 422),
    ("POST", "/lease", {"operator": "two\nlines"}, 422),
    ("POST", "/lease/hand-over", {}, 422),
    ("POST", "/no-such-thing", None, 404),
    ("PATCH", "/state", None, 405),
]


@pytest.mark.parametrize(("method", "path", "body", "status"), BAD)
def test_bad_input_is_refused_and_nothing_moves(
    driver: ApiClient, method: str, path: str, body: Any, status: int
) -> None:
    before = driver.state()
    refusal = driver.refused(method, path, body)
    assert refusal["status"] == status
    after = driver.state()
    assert after["true"] == before["true"]
    assert after["teleoperation"] == before["teleoperation"]
    assert after["priority"] == before["priority"]
    assert (after["engaged"], after["path"]) == (False, None)
    assert after["safety"]["state"] == "ENABLED"


@pytest.mark.parametrize(
    "content", [b"", b"{", b"\xff\xfe", b"[" * 50_000, b'{"position_mm":[1,2,3]', b"null"]
)
def test_what_is_not_json_is_refused(driver: ApiClient, content: bytes) -> None:
    headers = {"Content-Type": "application/json"}
    answer = driver.http.post("/target", content=content, headers=headers)
    assert answer.status_code in (400, 422)
    assert answer.headers["content-type"] == "application/problem+json"
    assert driver.state()["engaged"] is False


def test_a_bad_csv_names_file_line_and_column(driver: ApiClient) -> None:
    refusal = driver.refused("POST", "/path", {"csv": CSV.replace("-5", "five"), "name": "my.csv"})
    assert refusal["code"] == "path_file"
    assert (refusal["file"], refusal["line"], refusal["column"]) == ("my.csv", 3, "z_mm")
    assert "my.csv, line 3, column z_mm" in refusal["detail"]


def test_nothing_moves_unless_enabled(operator: ApiClient) -> None:
    requests: list[tuple[str, Any]] = [
        ("/target", {"position_mm": operator.state()["true"]["position_mm"]}),
        ("/leader", LEADER),
        ("/path", {"experiment": "circle"}),
    ]
    for path, body in requests:
        refusal = operator.refused("POST", path, body)
        assert (refusal["status"], refusal["code"]) == (409, "not_ready")
        assert "enable it first" in refusal["detail"]
    assert operator.state()["engaged"] is False


def test_a_target_waits_for_hold_to_move(driver: ApiClient) -> None:
    driver.done("PUT", "/teleoperation", {"hold_to_move": True})
    before = driver.state()
    refusal = driver.refused("POST", "/target", {"position_mm": beside(before, 0, 5, 0)})
    assert refusal["code"] == "not_ready"
    assert "hold-to-move" in refusal["detail"]
    assert driver.state()["true"] == before["true"]
