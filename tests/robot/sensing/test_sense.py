"""The sensing stage: bad input is named and nothing is reported; good input is an estimate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robot.calibration import Calibration
from robot.instrument_robot import InstrumentRobot
from robot.records import INPUT, OUTCOME
from robot.sensing.faults import REASONS, SensingFault
from robot.tendons import bend_from_servos, servo_angles
from server.configuration_file import load
from tests.robot.drive import with_steady_cells

DT = 0.002


class Bench:
    """A robot that stands, told what straight-forward sensors would say of its commanded self."""

    def __init__(self) -> None:
        self.configuration = with_steady_cells(load(None))
        self.robot = InstrumentRobot(self.configuration, Calibration())
        self.state = self.robot.initial_state()
        self.input = np.zeros(1, INPUT)
        first = self.input[0]
        first["dt_s"], first["measured_valid"] = DT, 1
        first["measured_q"] = self.state["x"][0, :7]
        u, v = self.state["x"][0, 7:9]
        servo = np.empty(4)
        servo_angles(u, v, 0.0018, 0.0054, servo)
        first["measured_servo"] = servo
        first["trocar_position"] = self.configuration.trocar.position_m
        first["settings"]["sensing"] = first["tension_cells"] = 1
        section = self.configuration.sensing
        self.per_rad = section.bending_stiffness_n_m2 / (0.03 * 0.0018)
        bend = np.array([u, -v, -u, v])
        first["measured_tension"] = section.pretension_n + 0.5 * self.per_rad * bend
        tracker = first["tracker"]
        tracker["sequence"], tracker["age_s"] = 1, 0.02
        tracker["position"] = self.state["tip_position"][0]
        outcome = np.zeros(1, OUTCOME)
        self.robot.tick(self.state, self.input, outcome)
        tracker["wxyz"] = outcome["report"]["commanded_wxyz"][0]

    def ticks(self, count: int = 40) -> Any:
        """Run; the last report."""
        outcome = np.zeros(1, OUTCOME)
        for _ in range(count):
            self.robot.tick(self.state, self.input, outcome)
            self.state = outcome["state"].copy()
        return outcome["report"][0]


def fault_of(report: Any) -> SensingFault:
    return SensingFault(int(report["estimate_fault"]))


def test_good_readings_give_an_estimate() -> None:
    bench = Bench()
    report = bench.ticks()
    assert fault_of(report) is SensingFault.NONE
    # The readings are those of a segment without friction and chords: only roughly free of force.
    assert np.linalg.norm(report["estimate_force"]) < 0.3
    tip = bench.state["tip_position"][0]
    assert report["estimate_position"] == pytest.approx(tip, abs=5e-4)
    u, v = report["estimate_modes"][4], report["estimate_modes"][0]
    told = bend_from_servos(bench.input["measured_servo"][0], 0.0018, 0.0054)
    assert (u, v) == pytest.approx(told, abs=0.05)
    covariance = report["estimate_force_covariance"]
    assert covariance == pytest.approx(covariance.T, abs=1e-12)
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()


def _no_cells(i: Any) -> None:
    i["tension_cells"] = 0


def _missing(i: Any) -> None:
    i["measured_tension"][2] = np.nan


def _saturated(i: Any) -> None:
    i["measured_tension"][1] = 70.0


def _broken(i: Any) -> None:
    i["measured_tension"][0] = 0.01


def _lost(i: Any) -> None:
    i["tracker"]["age_s"] = 0.2


def _never_seen(i: Any) -> None:
    i["tracker"]["sequence"] = 0


def _not_a_pose(i: Any) -> None:
    i["tracker"]["wxyz"] = 0.0


def _elsewhere(i: Any) -> None:
    i["tracker"]["position"] += [0.0, 0.02, 0.01]


def _no_joint(i: Any) -> None:
    i["measured_q"][3] = np.nan


def _off(i: Any) -> None:
    i["settings"]["sensing"] = 0


@pytest.mark.parametrize(
    ("breaking", "faults"),
    [
        (_no_cells, {SensingFault.NO_TENSION_CELLS}),
        (_missing, {SensingFault.CELL_MISSING}),
        (_saturated, {SensingFault.CELL_SATURATED}),
        (_broken, {SensingFault.TENDON_BROKEN}),
        (_lost, {SensingFault.TRACKER_LOST}),
        (_never_seen, {SensingFault.TRACKER_LOST}),
        (_not_a_pose, {SensingFault.TRACKER_LOST}),
        (_elsewhere, {SensingFault.POSE_IMPOSSIBLE, SensingFault.NOT_CONVERGED}),
        (_no_joint, {SensingFault.NOT_CONVERGED}),
        (_off, {SensingFault.OFF}),
    ],
)
def test_bad_input_is_named_and_nothing_is_reported(
    breaking: object, faults: set[SensingFault]
) -> None:
    bench = Bench()
    assert fault_of(bench.ticks()) is SensingFault.NONE
    assert callable(breaking)
    breaking(bench.input[0])
    report = bench.ticks(1)
    assert fault_of(report) in faults
    for field in ("force", "force_covariance", "modes", "position", "wxyz", "tension"):
        assert not report[f"estimate_{field}"].any()


def test_the_estimate_returns_with_good_input() -> None:
    bench = Bench()
    bench.ticks()
    bench.input["tracker"]["age_s"] = 0.2
    bench.ticks(3)
    bench.input["tracker"]["age_s"] = 0.02
    assert fault_of(bench.ticks(1)) is SensingFault.NONE


def test_every_fault_says_what_to_do() -> None:
    assert set(REASONS) == set(SensingFault)
    for fault, (words, action) in REASONS.items():
        assert words
        assert action or fault is SensingFault.NONE
