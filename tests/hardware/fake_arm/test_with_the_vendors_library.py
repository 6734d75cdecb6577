"""The vendor's own library, unmodified, takes the fake controller for an xArm 7."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from xarm.core.config.x_config import XCONF
from xarm.wrapper import XArmAPI

from hardware.fake_arm.program import FakeArm
from tests.hardware.fake_arm.rig import fake_arm, limits

READY, STOPPED = 2, 4
MODE_POSITION, MODE_SERVO = 0, 1


def until(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.01)


def connect(fake: FakeArm, report: str) -> Any:
    XCONF.SocketConf.TCP_CONTROL_PORT = fake.address.control
    return XArmAPI(fake.address.host, is_radian=True, report_type=report, forbid_uds=True)


@pytest.fixture(scope="module")
def fake() -> Iterator[FakeArm]:
    with fake_arm() as running:
        yield running


@pytest.fixture(scope="module")
def library(fake: FakeArm) -> Iterator[Any]:
    arm = connect(fake, "rich")
    yield arm
    arm.disconnect()


@pytest.fixture
def arm(library: Any) -> Any:
    """Ready to be streamed to."""
    for act in (library.clean_error, library.clean_warn, library.motion_enable):
        assert act() == 0
    assert library.set_mode(MODE_SERVO) == 0
    assert library.set_state(0) == 0
    assert library.get_state() == (0, READY)
    return library


def joints(arm: Any) -> np.ndarray:
    code, q = arm.get_servo_angle()
    assert code == 0
    return np.array(q)


def stream(arm: Any, step: np.ndarray, count: int) -> np.ndarray:
    q = joints(arm)
    for _ in range(count):
        q = q + step
        assert arm.set_servo_angle_j(q.tolist()) == 0
    return q


def test_it_knows_what_it_talks_to(arm: Any) -> None:
    assert arm.connected
    assert (arm.axis, arm.device_type, arm.version_number) == (7, 7, (1, 12, 10))


def test_joints_go_where_they_are_streamed_and_both_ways_tell_it(arm: Any, fake: FakeArm) -> None:
    fake.goals.clear()
    goal = stream(arm, np.linspace(-0.004, 0.004, 7), 25)
    until(lambda: bool(np.allclose(joints(arm), goal, rtol=0, atol=1e-5)))
    until(lambda: bool(np.allclose(arm.angles, goal, rtol=0, atol=1e-5)))
    assert len(fake.goals) == 25
    np.testing.assert_allclose(fake.goals[-1].q, goal, rtol=0, atol=1e-6)
    until(lambda: (arm.state, arm.mode, arm.error_code) == (READY, MODE_SERVO, 0))


@pytest.mark.parametrize("joint", [0, 3, 6])
def test_what_is_too_fast_is_refused_with_an_error(arm: Any, fake: FakeArm, joint: int) -> None:
    q = joints(arm)
    q[joint] += 0.05
    assert arm.set_servo_angle_j(q.tolist()) == 1
    assert arm.get_err_warn_code() == (0, [24, 0])
    assert arm.get_state() == (0, STOPPED)
    q[joint] -= 0.05
    np.testing.assert_allclose(fake.controller.q, q, rtol=0, atol=1e-5)


def test_what_leaves_a_joints_range_is_refused_with_an_error(arm: Any, fake: FakeArm) -> None:
    _, upper = limits()
    steps = int((upper[3] - joints(arm)[3]) / 0.03)
    q = stream(arm, np.eye(7)[3] * 0.03, steps)
    q[3] += 0.03
    # The vendor's library has a check of its own before the controller's.
    assert arm.core.move_servoj(q.tolist(), 0, 0, 0)[0] == 1
    assert arm.get_err_warn_code() == (0, [23, 0])
    assert fake.controller.q[3] < upper[3]


def test_after_an_error_nothing_moves_until_cleaned_enabled_and_started(arm: Any) -> None:
    q = joints(arm)
    far = [q[0] + 1.0, *q[1:]]
    assert arm.set_servo_angle_j(far) == 1
    assert arm.set_servo_angle_j(q.tolist()) == 1
    assert arm.clean_error() == 0
    assert arm.set_servo_angle_j(q.tolist()) == 9
    assert arm.set_state(0) == 0
    assert arm.set_servo_angle_j(q.tolist()) == 0


def test_an_emergency_stop_lasts_while_it_is_pressed(arm: Any, fake: FakeArm) -> None:
    fake.inject("emergency-stop")
    until(lambda: arm.error_code == 1)
    assert arm.clean_error() != 0
    assert arm.get_err_warn_code() == (0, [1, 0])
    fake.clear("emergency-stop")
    assert arm.clean_error() == 0
    assert arm.set_state(0) == 0
    assert arm.get_state() == (0, STOPPED)
    assert arm.motion_enable() == 0
    assert arm.set_state(0) == 0
    assert arm.get_state() == (0, READY)


def test_without_torque_or_in_another_mode_nothing_is_followed(arm: Any, fake: FakeArm) -> None:
    q = joints(arm)
    near = [q[0] + 0.01, *q[1:]]
    assert arm.set_mode(MODE_POSITION) == 0
    assert arm.set_state(0) == 0
    assert arm.set_servo_angle_j(near) == 10
    assert arm.set_mode(MODE_SERVO) == 0
    assert arm.set_state(0) == 0
    assert arm.motion_enable(enable=False) == 0
    assert arm.set_servo_angle_j(near) == 9
    time.sleep(0.05)
    np.testing.assert_allclose(fake.controller.q, q, rtol=0, atol=1e-5)
    until(lambda: not any(arm.motor_enable_states[:7]))


def test_what_is_no_number_or_unknown_gives_a_warning(arm: Any) -> None:
    q = joints(arm)
    assert arm.set_servo_angle_j([math.nan, *q[1:]]) != 0
    assert arm.get_err_warn_code() == (0, [0, 12])
    assert arm.clean_warn() == 0
    assert arm.set_counter_increase() != 0
    assert arm.get_err_warn_code() == (0, [0, 13])
    assert arm.clean_warn() == 0


def test_payload_and_sensitivity_are_taken(arm: Any, fake: FakeArm) -> None:
    assert arm.set_tcp_load(0.8, [0, 0, 60]) == 0
    np.testing.assert_allclose(fake.controller.payload, (0.8, 0, 0, 60), rtol=1e-6)
    until(lambda: bool(arm.tcp_load[0] == 0.8))
    assert arm.core.set_collis_sens(5)[0] == 0
    assert fake.controller.collision_sensitivity == 5


def test_the_fast_report_and_a_new_connection_after_a_drop(fake: FakeArm) -> None:
    fake.inject("drop")
    arm = connect(fake, "real")
    try:
        until(lambda: bool(np.allclose(arm.angles, fake.controller.q, rtol=0, atol=1e-5)))
        fake.inject("drop")
        until(lambda: not arm.connected)
    finally:
        arm.disconnect()
