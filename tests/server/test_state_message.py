"""From records to state messages: every field there, units right, nothing that JSON cannot say."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import (
    RECORD,
    Alignment,
    Case,
    Compensation,
    Coordinates,
    LeaderKind,
    Refusal,
    Safety,
    Solver,
)
from robot.safety import REASONS, Event
from server.configuration_file import load
from server.web.instrument_message import InstrumentMessages
from server.web.state_message import OperatorView, StateMessages, Surroundings
from server.web.state_schema import StateMessage
from server.web.state_source import LoopMeter

NOW = 5_000_000_000
RUNNING = Surroundings(NOW, "running", plant="kinematic", realtime="SCHED_FIFO")
NOBODY = OperatorView()


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return load(None)


@pytest.fixture(scope="module")
def messages(configuration: Configuration) -> StateMessages:
    return InstrumentMessages(configuration)


@pytest.fixture
def record() -> NDArray[Any]:
    record = np.zeros(1, RECORD)
    record["header"]["tick"], record["header"]["stamp_ns"] = 7, NOW - 3_000_000
    record["header"]["time_ns"], record["header"]["lateness_ns"] = 14_000_000, 12_000
    state, report = record["outcome"]["state"], record["outcome"]["report"]
    state["safety"], state["reason"] = Safety.ENABLED, Event.ENABLE
    report["desired_position"] = (0.45, -0.001, 0.02)
    report["desired_wxyz"] = (1.0, 0.0, 0.0, 0.0)
    report["theta"], report["delta"] = math.radians(30.0), math.radians(-30.0)
    report["x"][0] = np.r_[np.deg2rad(np.arange(7) * 10.0), 0.1, 0.2, 0.4]
    record["truth"]["position_error"] = 2e-6
    record["truth"]["orientation_error"] = math.radians(0.01)
    record["truth"]["rcm_error"] = 1e-7
    report["residual_linear"], report["residual_angular"] = 0.001, math.radians(2.0)
    record["input"]["trocar_position"] = (0.4, 0.0, 0.12)
    return record


def test_every_field_is_there_and_no_other(messages: StateMessages, record: NDArray[Any]) -> None:
    message = messages.message(record, RUNNING, OperatorView("Ada", True, 4.2))
    StateMessage.model_validate(message)
    assert msgspec.json.decode(msgspec.json.encode(message)) == message


def test_people_read_millimetres_and_degrees(messages: StateMessages, record: NDArray[Any]) -> None:
    message = messages.message(record, RUNNING, NOBODY)
    assert message["desired"]["position_mm"] == [450.0, -1.0, 20.0]
    assert message["joints_deg"] == pytest.approx([0, 10, 20, 30, 40, 50, 60])
    assert message["bend_deg"] == pytest.approx(60.0)
    assert message["direction_deg"] == pytest.approx(-30.0)
    assert message["errors"]["position_mm"] == pytest.approx(0.002)
    assert message["errors"]["orientation_deg"] == pytest.approx(0.01)
    assert message["errors"]["rcm_mm"] == pytest.approx(1e-4)
    assert message["residuals"]["linear_mm_s"] == pytest.approx(1.0)
    assert message["residuals"]["angular_deg_s"] == pytest.approx(2.0)
    assert message["trocar_mm"] == [400.0, 0.0, 120.0]
    assert message["age_ms"] == pytest.approx(3.0)
    assert message["loop"]["lateness_us"] == pytest.approx(12.0)
    assert message["lambda"]["value"] == pytest.approx(0.4)


def test_what_is_not_a_number_is_null(messages: StateMessages, record: NDArray[Any]) -> None:
    record["truth"]["position_error"] = math.nan
    record["truth"]["position"] = (math.inf, 0.0, -math.inf)
    message = messages.message(record, RUNNING, NOBODY)
    StateMessage.model_validate(message)
    assert message["errors"]["position_mm"] is None
    assert message["true"]["position_mm"] == [None, 0.0, None]


def test_before_the_first_record_only_the_configuration_is_known(
    messages: StateMessages, configuration: Configuration
) -> None:
    around = Surroundings(NOW, "starting", "loading the controller")
    message = messages.message(None, around, NOBODY)
    StateMessage.model_validate(message)
    assert message["tick"] is None
    assert message["joints_deg"] == [None] * 7
    assert message["safety"]["state"] == "DISABLED"
    assert message["safety"]["reason"] == "loading the controller"
    assert message["safety"]["reason_code"] == "control_starting"
    assert message["priority"]["case"] == configuration.priority.case
    assert message["teleoperation"]["motion_scale_max"] == 2.0
    assert message["bend_limit_deg"] == 90.0


@pytest.mark.parametrize("event", Event)
def test_every_reason_says_what_to_do(
    messages: StateMessages, record: NDArray[Any], event: Event
) -> None:
    record["outcome"]["state"]["reason"] = event
    safety = messages.message(record, RUNNING, NOBODY)["safety"]
    assert (safety["reason"], safety["action"]) == REASONS[event]


@pytest.mark.parametrize("refusal", [r for r in Refusal if r != Refusal.NONE])
def test_a_refused_wish_is_explained(
    messages: StateMessages, record: NDArray[Any], refusal: Refusal
) -> None:
    record["outcome"]["report"]["target_refused"] = refusal
    safety = messages.message(record, RUNNING, NOBODY)["safety"]
    assert safety["reason_code"] == refusal.name.lower()
    assert safety["reason"]
    assert safety["action"]
    record["outcome"]["state"]["safety"] = Safety.PAUSED
    assert messages.message(record, RUNNING, NOBODY)["safety"]["reason_code"] == "ready"


def test_every_choice_has_a_name(messages: StateMessages, record: NDArray[Any]) -> None:
    settings = record["input"]["settings"]
    for field, choices in (
        ("case", Case), ("solver", Solver), ("coordinates", Coordinates), ("alignment", Alignment),
        ("compensation", Compensation),
    ):  # fmt: skip
        for choice in choices:
            settings[field] = choice
            StateMessage.model_validate(messages.message(record, RUNNING, NOBODY))
    for leader in LeaderKind:
        record["outcome"]["state"]["leader_kind"] = leader
        StateMessage.model_validate(messages.message(record, RUNNING, NOBODY))


def test_a_path_has_name_and_progress(messages: StateMessages, record: NDArray[Any]) -> None:
    assert messages.message(record, RUNNING, NOBODY)["path"] is None
    record["header"]["path_id"], record["header"]["path_progress"] = 3, 0.25
    around = Surroundings(NOW, "running", path_name="circle")
    message = messages.message(record, around, NOBODY)
    assert message["path"] == {"name": "circle", "progress": 0.25}


def test_what_is_touched_and_done_on_a_board(messages: StateMessages, record: NDArray[Any]) -> None:
    truth, tick_input = record["truth"], record["input"]
    truth["contact_count"], tick_input["measured_contact"] = 3, 0.75
    truth["rings_passed"], truth["rings_touched"] = 0b1011, 0b100
    truth["ball_progress"] = 0.5
    tick_input["tension_cells"], tick_input["measured_tension"] = 1, (1.0, 2.0, 3.0, 4.0)
    found = {}
    for board in ("none", "ring-board", "silicon-arc"):
        found[board] = messages.message(record, replace(RUNNING, board=board), NOBODY)
        StateMessage.model_validate(found[board])
    assert found["none"]["contact"] == {"count": 3, "force_n": 0.75, "limit_n": 2.0}
    assert found["none"]["tension_n"] == [1.0, 2.0, 3.0, 4.0]
    assert (found["none"]["rings"], found["none"]["ball"]) == (None, None)
    assert found["ring-board"]["rings"] == {"passed": 3, "touched": 1, "total": 6}
    assert found["silicon-arc"]["ball"] == {"progress": 0.5}
    record["outcome"]["state"]["contact_allowance"] = 2.5
    assert messages.message(record, RUNNING, NOBODY)["contact"]["limit_n"] == 2.5


def test_the_tracker_and_its_correction(messages: StateMessages, record: NDArray[Any]) -> None:
    off = messages.message(record, RUNNING, NOBODY)["tracker"]
    assert off == {"on": False, "age_ms": None, "correction_mm": 0.0, "correction_deg": 0.0}
    record["input"]["settings"]["use_tracker"] = 1
    record["input"]["tracker"]["sequence"], record["input"]["tracker"]["age_s"] = 5, 0.02
    record["outcome"]["state"]["correction_position"] = (3e-3, 0.0, 4e-3)
    record["outcome"]["state"]["correction_rotation"] = (0.0, math.radians(2.0), 0.0)
    on = messages.message(record, RUNNING, NOBODY)["tracker"]
    assert on == {"on": True, "age_ms": 20.0, "correction_mm": 5.0, "correction_deg": 2.0}


def test_which_robot_it_is(messages: StateMessages, record: NDArray[Any]) -> None:
    exact = messages.message(record, RUNNING, NOBODY)
    assert (exact["plant"], exact["preset"], exact["seed"]) == ("kinematic", None, None)
    physical = messages.message(record, replace(RUNNING, plant="physics"), NOBODY)
    assert (physical["preset"], physical["seed"]) == ("paper", 1)


def test_the_meter_measures_rate_and_real_time_factor(record: NDArray[Any]) -> None:
    meter = LoopMeter()
    assert meter.measure() == (None, None)
    for tick in range(1000):
        record["header"]["tick"] = tick
        record["header"]["stamp_ns"] = tick * 4_000_000
        record["header"]["time_ns"] = tick * 2_000_000
        meter.take(record)
    rate, factor = meter.measure()
    assert rate == pytest.approx(250.0)
    assert factor == pytest.approx(0.5)
    record["header"]["tick"] = 0
    meter.take(record)
    assert meter.measure() == (None, None)
