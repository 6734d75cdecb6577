"""What the state message tells of sensing: valid or not, never a number that is none."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from robot.records import RECORD, ErrorSource
from robot.sensing.faults import REASONS, SensingFault
from server.configuration_file import load
from server.web.instrument_message import InstrumentMessages
from server.web.state_message import OperatorView, StateMessages, Surroundings
from server.web.state_schema import StateMessage

NOW = 5_000_000_000
RUNNING = Surroundings(NOW, "running", plant="physics")
NOBODY = OperatorView()


@pytest.fixture(scope="module")
def messages() -> StateMessages:
    return InstrumentMessages(load(None))


@pytest.fixture
def record() -> NDArray[Any]:
    """A valid estimate with one direction that is not observable."""
    record = np.zeros(1, RECORD)
    record["header"]["tick"], record["header"]["stamp_ns"] = 7, NOW
    tick_input, report = record["input"][0], record["outcome"]["report"][0]
    tick_input["settings"]["sensing"] = tick_input["tension_cells"] = 1
    tick_input["measured_tension"] = (2.0, 1.9, 1.8, 2.1)
    report["estimate_tension"] = (2.01, 1.91, 1.81, 2.11)
    report["estimate_force"] = (0.3, 0.4, 0.1)
    report["estimate_force_covariance"] = np.diag([0.01**2, 0.02**2, 0.3**2])
    report["estimate_position"], report["estimate_wxyz"] = (0.5, 0.0, 0.01), (1.0, 0.0, 0.0, 0.0)
    record["truth"]["contact_wrench"] = (0.31, 0.39, 0.0, 0.0, 0.0, 0.0)
    return record


def told(messages: StateMessages, record: NDArray[Any], around: Surroundings) -> dict[str, Any]:
    message = messages.message(record, around, NOBODY)
    StateMessage.model_validate(message)
    assert msgspec.json.decode(msgspec.json.encode(message)) == message
    return message


def test_a_valid_estimate_says_how_well_each_direction_is_known(
    messages: StateMessages, record: NDArray[Any]
) -> None:
    message = told(messages, record, RUNNING)
    sensing = message["sensing"]
    assert (sensing["enabled"], sensing["valid"], sensing["fault"]) == (True, True, "none")
    assert sensing["force_n"] == [0.3, 0.4, 0.1]
    size = math.hypot(0.3, 0.4, 0.1)
    assert sensing["magnitude_n"] == pytest.approx(size, abs=1e-4)
    spread = math.hypot(0.3 * 0.01, 0.4 * 0.02, 0.1 * 0.3) / size
    assert sensing["deviation_n"] == pytest.approx(spread, abs=1e-4)
    assert [axis["observable"] for axis in sensing["axes"]] == [True, True, False]
    assert [axis["deviation_n"] for axis in sensing["axes"]] == [0.01, 0.02, 0.3]
    assert [axis["component_n"] for axis in sensing["axes"]] == [0.3, 0.4, 0.1]
    assert sensing["axes"][2]["direction"] == [0.0, 0.0, 1.0]
    assert sensing["true_force_n"] == [0.31, 0.39, 0.0]
    assert sensing["tip"]["position_mm"] == [500.0, 0.0, 10.0]
    assert (sensing["cells"], sensing["tension_n"]) == (True, [2.01, 1.91, 1.81, 2.11])
    assert message["tension_n"] == [2.0, 1.9, 1.8, 2.1]


@pytest.mark.parametrize("fault", [fault for fault in SensingFault if fault])
def test_an_invalid_estimate_has_no_numbers_but_a_reason(
    messages: StateMessages, record: NDArray[Any], fault: SensingFault
) -> None:
    record["outcome"]["report"]["estimate_fault"] = fault
    sensing = told(messages, record, RUNNING)["sensing"]
    assert (sensing["valid"], sensing["fault"]) == (False, fault.name.lower())
    assert (sensing["reason"], sensing["action"]) == REASONS[fault]
    assert sensing["axes"] == []
    assert sensing["magnitude_n"] is sensing["deviation_n"] is None
    for name in ("force_n", "tension_n"):
        assert set(sensing[name]) == {None}
    assert sensing["tip"]["position_mm"] == [None] * 3
    assert sensing["true_force_n"] == [0.31, 0.39, 0.0], "the truth needs no estimate"


def test_what_no_cell_measures_is_not_zero(messages: StateMessages, record: NDArray[Any]) -> None:
    record["input"]["measured_tension"][0, 2] = math.nan
    assert told(messages, record, RUNNING)["tension_n"] == [2.0, 1.9, None, 2.1]
    record["input"]["tension_cells"] = 0
    assert told(messages, record, RUNNING)["tension_n"] == [None] * 4


def test_numbers_that_are_none_make_the_estimate_invalid(
    messages: StateMessages, record: NDArray[Any]
) -> None:
    record["outcome"]["report"]["estimate_force_covariance"][0, 1, 1] = math.nan
    sensing = told(messages, record, RUNNING)["sensing"]
    assert (sensing["valid"], sensing["fault"]) == (False, "not_converged")


def test_the_true_force_is_told_where_it_is_known(
    messages: StateMessages, record: NDArray[Any]
) -> None:
    kinematic = told(messages, record, replace(RUNNING, plant="kinematic"))
    assert kinematic["sensing"]["true_force_n"] == [None] * 3
    assert kinematic["actuation"] is None
    record["truth"]["source"] = ErrorSource.MEASURED
    assert told(messages, record, RUNNING)["sensing"]["true_force_n"] == [None] * 3
    assert told(messages, record, RUNNING)["actuation"] == "servos"


def test_an_old_record_is_no_estimate(messages: StateMessages, record: NDArray[Any]) -> None:
    sensing = told(messages, record, replace(RUNNING, control="down"))["sensing"]
    assert (sensing["valid"], sensing["fault"]) == (False, "control_down")
    assert sensing["force_n"] == [None] * 3
    message = messages.message(None, RUNNING, NOBODY)
    StateMessage.model_validate(message)
    assert (message["sensing"]["enabled"], message["sensing"]["valid"]) == (True, False)


def test_the_message_tells_what_the_tendons_hold(
    messages: StateMessages, record: NDArray[Any]
) -> None:
    record["input"]["settings"]["tendon_control"] = 1
    record["input"]["settings"]["co_contraction"] = 2.5
    command = record["outcome"]["command"][0]
    command["tendon_mode"], command["tension"] = (0, 1, 1, 0), (3.25, 2.5, 2.5, 2.75)
    told = messages.message(record, RUNNING, NOBODY)["tendons"]
    assert (told["control"], told["co_contraction_n"]) == ("hybrid", 2.5)
    assert told["holds"] == ["position", "tension", "tension", "position"]
    assert told["wanted_n"] == [None, 2.5, 2.5, None]
    assert told["stiffness_mnm_rad"] == pytest.approx([26.6, 26.6], abs=0.2)
    record["input"]["measured_tension"][0, 1] = math.nan
    assert messages.message(record, RUNNING, NOBODY)["tendons"]["stiffness_mnm_rad"] == [None, None]
