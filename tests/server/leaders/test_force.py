"""The force: a spring toward where the tip could follow, and nothing at any other time."""

from __future__ import annotations

import time

import numpy as np
import pytest

from robot.configuration import Stylus
from robot.records import INSTRUMENT, LeaderKind, Safety
from robot.rotations import exponential
from server.leaders.control_view import SILENT_NS, ControlView
from server.leaders.force import SpringForce
from server.leaders.led_stylus import NO_FORCE, ONSET_S
from tests.server.leaders.conftest import ControlSide

LATER = 10_000_000_000


@pytest.fixture
def view(control: ControlSide) -> ControlView:
    return ControlView(control.directory, INSTRUMENT)


@pytest.fixture
def spring(stylus_configuration: Stylus, view: ControlView) -> SpringForce:
    return SpringForce(stylus_configuration, view)


def full(spring: SpringForce, position: tuple[float, float, float]) -> np.ndarray:
    """The force long after the stylus began to lead."""
    spring.at(position, 0)
    spring.at(position, 1)
    return np.array(spring.at(position, LATER))


def test_a_tip_that_follows_is_not_felt(
    control: ControlSide, spring: SpringForce, view: ControlView
) -> None:
    control.say(Safety.ENABLED, engaged=True)
    view.update(time.monotonic_ns())
    assert full(spring, (0.0, 0.0, 0.0)) == pytest.approx(np.zeros(3), abs=1e-12)


def test_it_pulls_back_to_where_the_tip_is(
    control: ControlSide,
    spring: SpringForce,
    view: ControlView,
    stylus_configuration: Stylus,
    rng: np.random.Generator,
) -> None:
    state = control.record["outcome"]["state"]
    turn = np.empty((3, 3))
    exponential(rng.uniform(-2.0, 2.0, 3), turn)
    state["anchor_rotation_base_leader"], state["anchor_scale"] = turn, 0.5
    state["anchor_tip_position"] = tip = rng.uniform(-0.1, 0.1, 3)
    state["anchor_leader_position"] = anchor = rng.uniform(-0.1, 0.1, 3)
    moved = np.array([0.004, -0.002, 0.006])
    control.record["outcome"]["report"]["commanded_position"] = tip
    control.say(Safety.ENABLED, engaged=True)
    view.update(time.monotonic_ns())
    x, y, z = anchor + moved
    expected = -stylus_configuration.force_stiffness_n_m * 0.5 * moved
    assert full(spring, (x, y, z)) == pytest.approx(expected, rel=1e-9)
    far = full(spring, (x + 5.0, y, z))
    assert np.linalg.norm(far) == pytest.approx(stylus_configuration.force_limit_n)


def test_it_begins_smoothly(control: ControlSide, spring: SpringForce, view: ControlView) -> None:
    control.say(Safety.ENABLED, engaged=True)
    view.update(time.monotonic_ns())
    sizes = [
        np.linalg.norm(spring.at((1.0, 0.0, 0.0), 1 + round(share * ONSET_S * 1e9)))
        for share in np.linspace(0.0, 1.2, 25)
    ]
    assert sizes[0] == 0.0
    assert max(np.diff(sizes)) < 0.05
    assert sizes[-1] == pytest.approx(0.88)


@pytest.mark.parametrize("why", ["paused", "not engaged", "another leads", "control is silent"])
def test_it_is_zero_unless_the_stylus_leads(
    control: ControlSide, spring: SpringForce, view: ControlView, why: str
) -> None:
    control.say(Safety.ENABLED, engaged=True)
    view.update(time.monotonic_ns())
    assert np.linalg.norm(full(spring, (1.0, 0.0, 0.0))) > 0.5
    now = time.monotonic_ns()
    if why == "another leads":
        control.say(Safety.ENABLED, engaged=True)
        control.record["outcome"]["state"]["leader_kind"] = int(LeaderKind.GIZMO)
        control._slot.write(control.record)
    elif why == "control is silent":
        now += 2 * SILENT_NS
    else:
        control.say(Safety.PAUSED if why == "paused" else Safety.ENABLED, engaged=why == "paused")
    view.update(now)
    assert spring.at((1.0, 0.0, 0.0), LATER) == NO_FORCE


def test_a_locked_place_is_no_wall(
    control: ControlSide, spring: SpringForce, view: ControlView
) -> None:
    control.record["outcome"]["state"]["anchor_lock_translation"] = 1
    control.say(Safety.ENABLED, engaged=True)
    view.update(time.monotonic_ns())
    assert tuple(full(spring, (1.0, 0.0, 0.0))) == NO_FORCE


@pytest.mark.parametrize("position", [(np.nan, 0.0, 0.0), (np.inf, 0.0, 0.0)])
def test_no_force_comes_of_a_pose_that_is_none(
    control: ControlSide,
    spring: SpringForce,
    view: ControlView,
    position: tuple[float, float, float],
) -> None:
    control.say(Safety.ENABLED, engaged=True)
    view.update(time.monotonic_ns())
    assert tuple(full(spring, position)) == NO_FORCE
