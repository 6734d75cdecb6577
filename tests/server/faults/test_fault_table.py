"""Faults of every kind, injected into real consoles: noticed, no motion, recovered by hand."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hardware.faulty_plant import plant_faults
from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.records import RECORD, Safety
from server.configuration_file import load
from server.faults.bench import Bench
from server.faults.fault import Fault, Finding, Group, is_met, row
from server.faults.soak import Reader, soak_faults
from server.faults.table import FAULTS, bench_configuration, chosen, measured
from server.faults.tension_faults import with_tension_unit
from server.faults.watching import after, commanded_path_mm, reach_mm, stands_still
from tests.server.api_client import ApiClient
from tests.server.console_process import ConsoleProcess, eventually

ON_THE_ROBOT = ("measurement-lost", "encoder-jump", "contact", "leader-teleport")


def patient_configuration() -> Configuration:
    """That of the bench, with a leader that may be late on a busy machine."""
    configuration = bench_configuration(load())
    patient = configuration.teleoperation.model_copy(update={"api_timeout_ms": 400.0})
    return configuration.model_copy(update={"teleoperation": patient})


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("faults")
    with Bench(folder, patient_configuration()) as running:
        yield running


@pytest.mark.parametrize("name", ON_THE_ROBOT)
def test_a_fault_is_noticed_stops_all_motion_and_is_left_by_hand_only(
    bench: Bench, name: str
) -> None:
    (fault,) = chosen([name])
    finding = fault.measure(bench, fault)
    assert finding.detected, finding
    assert fault.state is not None
    assert finding.state == fault.state.name
    assert finding.commanded_travel_mm is not None
    assert finding.commanded_travel_mm <= 0.1
    assert finding.stayed_stopped
    assert finding.recovered
    assert finding.recovery[-1:] == ("enable",)
    json.dumps(row(fault, finding, 1.0), allow_nan=False)


def test_a_tendon_that_breaks_while_tensions_are_held_is_noticed(tmp_path: Path) -> None:
    (fault,) = chosen(["tendon-broken"])
    with Bench(tmp_path, with_tension_unit(patient_configuration())) as bench:
        found_out = measured(bench, fault)
    assert found_out["state"] == "FAULT", found_out
    assert found_out["commanded_travel_mm"] <= 0.1
    assert found_out["stayed_stopped"]
    assert found_out["recovered"]
    assert found_out["recovery"] == "reset, then enable"


def test_what_cannot_be_drawn_stops_nothing(bench: Bench) -> None:
    (fault,) = chosen(["exception-in-a-plot"])
    found_out = measured(bench, fault)
    assert found_out["detected"], found_out
    assert found_out["state"] == "ENABLED"


def test_every_name_is_known_and_every_group_is_there() -> None:
    assert {fault.group for fault in FAULTS} == set(Group)
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
    with pytest.raises(UnknownName, match="crc-flip"):
        chosen(["rust"])
    assert {fault.name for fault in soak_faults()} <= {fault.name for fault in FAULTS}


def found(**values: Any) -> Finding:
    given = {"detected": True, "detected_within_ms": 5.0, "commanded_travel_mm": 0.0}
    return Finding(**{**given, "stayed_stopped": True, "recovered": True, **values})


def test_what_is_demanded() -> None:
    assert is_met(found(), 10.0)
    assert not is_met(found(detected=False), 10.0)
    assert not is_met(found(detected_within_ms=11.0), 10.0)
    assert not is_met(found(commanded_travel_mm=0.2), 10.0)
    assert not is_met(found(stayed_stopped=False), 10.0)
    assert not is_met(found(recovered=False), 10.0)
    assert is_met(found(tolerated=True, commanded_travel_mm=20.0, stayed_stopped=None), 10.0)


def records(count: int) -> np.ndarray:
    made = np.zeros(count, RECORD)
    made["header"]["stamp_ns"] = np.arange(count) * 2_000_000
    return made


def test_ways_are_measured_on_the_records() -> None:
    made = records(1001)
    angle = np.linspace(0.0, 2.0 * np.pi, 1001)
    made["truth"]["position"][:, 0] = 0.004 * np.cos(angle)
    made["outcome"]["report"]["commanded_position"][:, 0] = 0.004 * np.cos(angle)
    assert commanded_path_mm(made) == pytest.approx(16.0)
    assert reach_mm(made) == pytest.approx(8.0)
    assert len(after(made, 500, 0.5)) == 251
    assert stands_still(made)
    made["outcome"]["state"]["safety"][7] = Safety.ENABLED
    assert not stands_still(made)


def test_faults_are_for_the_operator_of_a_simulated_robot(
    console: ConsoleProcess, operator: ApiClient, watcher: ApiClient
) -> None:
    assert {one["name"] for one in watcher.call("GET", "/faults").json()} == set(
        plant_faults(load())
    )
    watcher.refused("POST", "/faults", {"name": "contact"})
    assert operator.refused("POST", "/faults", {"name": "rust"})["code"] == "unknown_name"
    operator.done("POST", "/enable")
    operator.done("POST", "/faults", {"name": "bus-lost"})
    eventually(lambda: operator.state()["safety"]["state"] == "PAUSED", "it pauses")
    assert operator.state()["safety"]["reason_code"] == "bus_lost"
    operator.refused("POST", "/enable")
    operator.done("DELETE", "/faults")
    eventually(lambda: operator.call("POST", "/enable").is_success, "it can be enabled again")


def test_the_reader_explains_every_transition(console: ConsoleProcess, driver: ApiClient) -> None:
    reader = Reader(console.directory, console.process.pid)
    eventually(lambda: reader.records, "it reads")
    acts = ("/pause", "/enable", "/emergency-stop", "/reset")
    for count, act in enumerate(acts, start=1):
        driver.done("POST", act)
        # Two acts within one tick would be one transition.
        eventually(lambda: reader.transitions >= count, f"{act} is seen")  # noqa: B023
    reader.close()
    assert reader.faults == []
    assert reader.records > 0
    roles = {one["process"] for one in reader.memory.summary()}
    assert {"control", "web", "recorder", "supervisor"} <= roles


def test_the_document_is_the_table() -> None:
    text = (Path(__file__).resolve().parents[3] / "docs" / "faults.md").read_text("utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    listed = [[cell.strip() for cell in line.strip("|").split("|")] for line in rows]

    def wanted(fault: Fault) -> list[str]:
        state = "goes on" if fault.state is None else fault.state.name
        return [f"`{fault.name}`", fault.title, state, fault.deadline.value]

    assert [one[:4] for one in listed] == [wanted(fault) for fault in FAULTS]
