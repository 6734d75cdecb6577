"""Arms without a wire: the locked one stands, the simulated one follows with its lags."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.arm.device import ArmDevice
from hardware.arm.locked import LockedArm
from hardware.arm.simulated import SimulatedArm
from hardware.devices import DEVICES, DeviceState
from hardware.physics.preset import PAPER
from robot.records import Readiness

START = np.array([0.1, 0.4, -0.2, 1.2, 0.1, 1.5, -0.3])
FAST = np.full(7, 1e9)
MS = 1_000_000


class Clock:
    """A clock that is turned by hand."""

    def __init__(self) -> None:
        self.now = 0

    def __call__(self) -> int:
        return self.now


def where(arm: ArmDevice) -> np.ndarray:
    q = np.empty(7)
    valid, age, event, _ = arm.read(q)
    assert (valid, age, event) == (True, 0.0, 0)
    return q


def readiness(arm: ArmDevice) -> int:
    return arm.read(np.empty(7)).readiness


def test_the_locked_arm_stands_whatever_is_asked(rng: np.random.Generator) -> None:
    arm = LockedArm(START)
    for act in (arm.hold, arm.recover, arm.release, arm.recover, arm.close):
        arm.write(rng.uniform(-1, 1, 7))
        act()
        np.testing.assert_array_equal(where(arm), START)


def test_each_joint_follows_with_its_own_lag(rng: np.random.Generator) -> None:
    clock = Clock()
    arm = SimulatedArm(START, PAPER, FAST, clock)
    goal = START + rng.uniform(-0.1, 0.1, 7)
    arm.write(goal)
    clock.now = 20 * MS
    left = np.exp(-0.020 / np.array(PAPER.joint_lag_s))
    np.testing.assert_allclose(where(arm), goal + left * (START - goal), rtol=0, atol=1e-12)


def test_it_does_not_matter_how_often_it_is_read(rng: np.random.Generator) -> None:
    clock, found = Clock(), []
    goal = START + rng.uniform(-0.1, 0.1, 7)
    for reads in (1, 7, 40):
        clock.now = 0
        arm = SimulatedArm(START, PAPER, FAST, clock)
        arm.write(goal)
        for read in range(1, reads + 1):
            clock.now = round(40 * MS * read / reads)
            q = where(arm)
        found.append(q)
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=0, atol=1e-9)


def test_no_joint_is_faster_than_it_may_be() -> None:
    clock = Clock()
    arm = SimulatedArm(START, PAPER, np.full(7, 0.5), clock)
    arm.write(START + 1.0)
    before = where(arm)
    for _ in range(50):
        clock.now += 2 * MS
        after = where(arm)
        assert np.max(np.abs(after - before)) <= 0.5 * 0.002 + 1e-12
        before = after
    np.testing.assert_allclose(before, START + 0.5 * 0.1, rtol=0, atol=1e-9)


@pytest.mark.parametrize("act", ["hold", "release"])
def test_holding_stands_at_once_and_lasts_until_recovered(act: str) -> None:
    clock = Clock()
    arm = SimulatedArm(START, PAPER, FAST, clock)
    arm.write(START + 0.1)
    clock.now = 10 * MS
    stood = where(arm)
    assert np.all(np.abs(stood - START) > 1e-3)
    getattr(arm, act)()
    arm.write(START + 0.2)
    clock.now = 1000 * MS
    np.testing.assert_array_equal(where(arm), stood)
    assert readiness(arm) == Readiness.TORQUE_OFF
    arm.recover()
    assert readiness(arm) == Readiness.READY
    clock.now = 1010 * MS
    np.testing.assert_array_equal(where(arm), stood)
    arm.write(stood + 0.05)
    clock.now = 3000 * MS
    np.testing.assert_allclose(where(arm), stood + 0.05, rtol=0, atol=1e-9)


def test_a_clock_that_goes_back_moves_nothing() -> None:
    clock = Clock()
    clock.now = 5 * MS
    arm = SimulatedArm(START, PAPER, FAST, clock)
    arm.write(START + 0.1)
    clock.now = 0
    q = where(arm)
    np.testing.assert_array_equal(q, START)
    assert not math.isnan(float(q.sum()))


def test_they_say_what_they_are() -> None:
    arms: dict[bytes, ArmDevice] = {
        b"locked": LockedArm(START),
        b"simulated": SimulatedArm(START, PAPER, FAST),
    }
    for kind, arm in arms.items():
        devices = np.ones(1, DEVICES)
        arm.fill_devices(devices)
        told = devices[0]["arm"]
        assert (told["kind"], told["state"]) == (kind, DeviceState.SIMULATED)
        assert devices[0]["bus"]["cycles"] == 1
