"""The sensed force on the stylus: what is known, scaled, turned, and gone when it is not valid."""

from __future__ import annotations

import time

import numpy as np
import pytest

from robot.configuration import Configuration
from robot.records import INSTRUMENT, Safety
from robot.rotations import exponential
from robot.sensing.faults import SensingFault
from server.leaders.control_view import ControlView
from server.leaders.force import SpringForce
from server.leaders.led_stylus import NO_FORCE
from server.leaders.sensed_force import FADE_S, SensedForce, known_part, make_force
from tests.server.leaders.conftest import ControlSide

STEP_NS = 2_000_000
EXPECTED_N = 0.5


class Hand:
    """A stylus that is moved toward a force, as a hand that presses does."""

    def __init__(
        self, control: ControlSide, configuration: Configuration, **stylus: object
    ) -> None:
        changed = configuration.stylus.model_copy(update={"force_source": "sensed", **stylus})
        self.control, self.view = control, ControlView(control.directory, INSTRUMENT)
        self.felt = SensedForce(changed, self.view, EXPECTED_N)
        self.now_ns, self.place = 10_000_000_000, np.zeros(3)
        self.report = control.record["outcome"]["report"][0]
        self.report["estimate_force_covariance"] = 1e-6 * np.eye(3)

    def press(self, direction: np.ndarray, seconds: float, speed: float = 0.02) -> np.ndarray:
        """Move against ``direction``; the force at the end."""
        force = NO_FORCE
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.control.say(Safety.ENABLED, engaged=True)
            self.view.update(time.monotonic_ns())
            self.now_ns += STEP_NS
            self.place -= direction * speed * STEP_NS * 1e-9
            x, y, z = self.place.tolist()
            force = self.felt.at((x, y, z), self.now_ns)
        return np.array(force)


def test_the_force_is_that_of_the_tip_in_the_frame_of_the_hand(
    control: ControlSide, configuration: Configuration, rng: np.random.Generator
) -> None:
    turn = np.empty((3, 3))
    exponential(rng.uniform(-2.0, 2.0, 3), turn)
    control.record["outcome"]["state"]["anchor_rotation_base_leader"] = turn
    hand = Hand(control, configuration, force_scale=2.0, force_damping_n_s_m=0.0)
    force = np.array([0.1, -0.05, 0.2])
    hand.report["estimate_force"] = force
    wanted = 2.0 * turn.T @ force
    felt = hand.press(wanted / np.linalg.norm(wanted), 1.0)
    assert felt == pytest.approx(wanted, rel=0.02)


def test_it_is_never_above_the_limit(control: ControlSide, configuration: Configuration) -> None:
    hand = Hand(control, configuration, force_scale=10.0)
    hand.report["estimate_force"] = (0.0, 0.0, 0.4)
    felt = hand.press(np.array([0.0, 0.0, 1.0]), 1.0)
    assert np.linalg.norm(felt) == pytest.approx(configuration.stylus.force_limit_n)


def test_it_fades_while_the_estimate_is_not_valid_and_comes_back(
    control: ControlSide, configuration: Configuration
) -> None:
    hand, up = Hand(control, configuration), np.array([0.0, 0.0, 1.0])
    hand.report["estimate_force"] = (0.0, 0.0, 0.3)
    before = np.linalg.norm(hand.press(up, 1.0))
    assert before > 0.25
    hand.report["estimate_fault"], hand.report["estimate_force"] = (
        int(SensingFault.CELL_MISSING),
        0.0,
    )
    fading = np.linalg.norm(hand.press(up, 0.5 * FADE_S))
    assert 0.1 * before < fading < 0.9 * before
    assert hand.press(up, FADE_S) == pytest.approx(np.zeros(3), abs=1e-12)
    hand.report["estimate_fault"], hand.report["estimate_force"] = 0, (0.0, 0.0, 0.3)
    assert np.linalg.norm(hand.press(up, 0.5)) > 0.25


def test_nothing_is_felt_while_the_stylus_does_not_lead(
    control: ControlSide, configuration: Configuration
) -> None:
    hand, up = Hand(control, configuration), np.array([0.0, 0.0, 1.0])
    hand.report["estimate_force"] = (0.0, 0.0, 0.3)
    hand.press(up, 0.5)
    control.say(Safety.PAUSED, engaged=True)
    hand.view.update(time.monotonic_ns())
    assert hand.felt.at((0.0, 0.0, 0.0), hand.now_ns + STEP_NS) == NO_FORCE


def test_what_is_uncertain_is_not_felt(rng: np.random.Generator) -> None:
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    force = axes @ [0.3, 0.3, 0.3]
    covariance = axes @ np.diag([0.001, 0.1, 0.3]) ** 2 @ axes.T
    along = axes.T @ known_part(force, covariance, EXPECTED_N)
    assert along[0] == pytest.approx(0.3, rel=0.01)
    assert 0.1 < along[1] < 0.2
    assert along[2] == pytest.approx(0.0, abs=1e-12)
    assert known_part(0.1 * force, covariance, EXPECTED_N) @ axes[:, 1] == pytest.approx(
        0.0, abs=1e-12
    )


def test_the_spring_is_what_is_felt_unless_one_asks_for_the_other(
    control: ControlSide, configuration: Configuration
) -> None:
    view = ControlView(control.directory, INSTRUMENT)
    assert isinstance(make_force(configuration, view), SpringForce)
    stylus = configuration.stylus.model_copy(update={"force_source": "sensed"})
    asked = configuration.model_copy(update={"stylus": stylus})
    assert isinstance(make_force(asked, view), SensedForce)
