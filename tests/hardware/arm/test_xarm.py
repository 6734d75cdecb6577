"""The real arm's driver through its vendor's library, against the fake controller."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from hardware.arm.errors import ArmLibraryMissing
from hardware.arm.xarm import XArm
from hardware.devices import DEVICES, DeviceState
from hardware.fake_arm.program import FakeArm
from robot.configuration import Configuration
from robot.records import Readiness
from robot.safety import Event
from tests.hardware.fake_arm.rig import START, address, configuration, fake_arm, limits

RATE_HZ = 500.0
PATIENT_S = 1.0
"""Age of a report at which these tests take the connection for lost: the machine may be busy."""


def to_fake() -> Configuration:
    """The one that comes along, with the fake as its arm, without real time."""
    given = configuration()
    hardware = given.hardware.model_copy(update={"arm": "xarm", "arm_address": str(address())})
    control = given.control.model_copy(update={"realtime": "off"})
    return given.model_copy(update={"hardware": hardware, "control": control})


class Rig:
    """An arm, its fake controller, and a hand that moves the first joint."""

    def __init__(self, arm: XArm, fake: FakeArm) -> None:
        self.arm, self.fake = arm, fake
        self.q = np.zeros(7)

    def reading(self) -> tuple[int, int]:
        """Event and readiness."""
        _, _, event, readiness = self.arm.read(self.q)
        return event, readiness

    def told(self) -> np.void:
        devices = np.zeros(1, DEVICES)
        self.arm.fill_devices(devices)
        found: np.void = devices[0]["arm"]
        return found

    def message(self) -> str:
        return bytes(self.told()["message"]).decode()

    def until(self, condition: Callable[[], bool], seconds: float = 60.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, (self.reading(), self.message(), self.fake.state())
            time.sleep(0.002)

    def until_ready(self) -> None:
        self.until(lambda: self.reading() == (Event.NOTHING, Readiness.READY))

    def write(self, q: np.ndarray, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.arm.write(q)
            time.sleep(1.0 / RATE_HZ)

    def move(self, way: float, ticks: int) -> np.ndarray:
        """From where it stands turn the first joint evenly; where that leads."""
        self.reading()
        begin = self.q.copy()
        self.fake.goals.clear()

        def followed() -> bool:
            self.write(begin - 1e-5)
            self.write(begin)
            return len(self.fake.goals) > 0

        self.until(followed)
        for tick in range(ticks + 1):
            self.write(begin + np.eye(7)[0] * way * tick / ticks)
        begin[0] += way
        return begin

    def arrived(self, goal: np.ndarray) -> Callable[[], bool]:
        def near() -> bool:
            self.reading()
            return bool(np.allclose(self.q, goal, rtol=0, atol=1e-5))

        return near

    def stands(self, ticks: int = 60) -> bool:
        """Whether nothing is streamed while commands stay as they are."""
        before = len(self.fake.goals)
        self.reading()
        self.write(self.q + 0.01, ticks)
        return len(self.fake.goals) == before


@pytest.fixture(scope="module")
def shared() -> Iterator[Rig]:
    with fake_arm() as fake:
        arm = XArm(to_fake(), PATIENT_S)
        yield Rig(arm, fake)
        arm.close()


@pytest.fixture
def rig(shared: Rig) -> Rig:
    """Connected, without faults, ready; the command that it does not follow yet is far away."""
    shared.reading()
    shared.write(shared.q - 0.5)
    shared.arm.recover()
    shared.until_ready()
    return shared


def test_it_prepares_itself_and_stands(rig: Rig) -> None:
    controller = rig.fake.controller
    assert (controller.mode, controller.enabled) == (1, True)
    np.testing.assert_allclose(controller.q, START, rtol=0, atol=1e-6)
    np.testing.assert_allclose(controller.payload, (0.8, 0.0, 0.0, 60.0), rtol=1e-6)
    told = rig.told()
    assert (told["state"], told["error"], told["kind"]) == (DeviceState.CONNECTED, 0, b"xarm")
    assert bytes(told["address"]).decode() == str(address())
    assert len(rig.fake.goals) == 0


def test_it_follows_and_never_faster_than_it_may(rig: Rig) -> None:
    goal = rig.move(0.15, 200)
    rig.until(rig.arrived(goal))
    steps = np.abs(np.diff([goal.q for goal in rig.fake.goals], axis=0))
    fastest = 1.25 * configuration().limits.joint_speed_rad_s
    assert np.max(steps) <= fastest / configuration().hardware.arm_rate_hz + 1e-6
    assert rig.fake.controller.error == 0


def test_far_or_jumping_commands_move_nothing(rig: Rig) -> None:
    rig.reading()
    stood = rig.q.copy()
    rig.write(stood + 0.3, 60)
    rig.until(lambda: "far from where" in rig.message())
    rig.move(0.02, 40)
    rig.reading()
    rig.write(rig.q + 0.4, 60)
    rig.until(lambda: "jumped" in rig.message())
    rig.reading()
    assert np.max(np.abs(rig.q - stood)) < 0.03
    assert rig.fake.controller.error == 0


def test_a_command_outside_of_the_limits_never_reaches_the_controller(rig: Rig) -> None:
    controller, upper = rig.fake.controller, limits()[1][5]
    controller.q[5] = controller.target[5] = upper - 0.005
    rig.until(rig.arrived(controller.q))
    goal = rig.move(0.01, 20)
    goal[5] = upper + 0.003
    rig.write(goal, 60)
    rig.until(lambda: "joint limits" in rig.message())
    assert controller.error == 0
    assert all(sent.q[5] <= upper for sent in rig.fake.goals)
    controller.q[5] = controller.target[5] = START[5]


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [
        ("emergency-stop", 1, "release it"),
        ("joint-error", 13, "joint 3"),
        ("collision", 31, "collision"),
        ("stopped", 0, "somebody else"),
    ],
)
@pytest.mark.parametrize("moving", [False, True])
def test_an_error_of_the_controller_lasts_until_recovered(
    rig: Rig, name: str, code: int, words: str, moving: bool
) -> None:
    if moving:
        rig.move(0.02, 20)
    rig.fake.inject(name)
    rig.until(lambda: rig.reading() == (Event.ARM_FAULT, Readiness.DEVICE_FAULT))
    assert words in rig.message()
    assert (rig.told()["state"], rig.told()["error"]) == (DeviceState.FAULT, code)
    assert rig.stands()
    rig.fake.clear(name)
    assert rig.stands()
    assert rig.reading() == (Event.ARM_FAULT, Readiness.DEVICE_FAULT)
    rig.arm.recover()
    rig.until_ready()
    rig.until(rig.arrived(rig.move(0.02, 20)))


def test_an_emergency_stop_that_is_still_pressed_is_not_recovered_from(rig: Rig) -> None:
    rig.fake.inject("emergency-stop")
    rig.until(lambda: rig.reading()[0] == Event.ARM_FAULT)
    rig.arm.recover()
    rig.until(lambda: rig.reading() == (Event.ARM_FAULT, Readiness.DEVICE_FAULT))
    assert not rig.fake.controller.enabled
    rig.fake.clear("emergency-stop")


def test_holding_stops_under_torque_and_releasing_closes_the_brakes(rig: Rig) -> None:
    rig.move(0.05, 50)
    rig.arm.hold()
    rig.until(lambda: rig.reading()[1] == Readiness.TORQUE_OFF)
    controller = rig.fake.controller
    assert (controller.state, controller.enabled) == (4, True)
    assert rig.stands()
    rig.arm.release()
    rig.until(lambda: not controller.enabled)
    rig.until(lambda: "brakes" in rig.message())
    assert rig.stands()
    rig.arm.recover()
    rig.until_ready()
    assert controller.enabled


@pytest.mark.parametrize("name", ["drop", "unplugged", "silent", "no-reports", "wrong-report"])
def test_a_lost_connection_comes_back_standing(rig: Rig, name: str) -> None:
    rig.move(0.02, 20)
    before = int(rig.told()["reconnects"])
    rig.fake.inject(name)
    rig.until(lambda: rig.reading() == (Event.ARM_LOST, Readiness.NOT_CONNECTED))
    rig.fake.clear(name)
    rig.until_ready()
    assert int(rig.told()["reconnects"]) == before + 1
    stood, sent = rig.fake.controller.q.copy(), len(rig.fake.goals)
    time.sleep(0.1)
    assert len(rig.fake.goals) == sent
    np.testing.assert_allclose(rig.fake.controller.q, stood, rtol=0, atol=1e-6)
    rig.until(rig.arrived(rig.move(0.02, 20)))


def test_an_answer_that_the_library_cannot_read_does_not_end_the_thread(rig: Rig) -> None:
    rig.fake.inject("short-answers")
    rig.until(lambda: rig.reading() == (Event.ARM_LOST, Readiness.NOT_CONNECTED))
    rig.fake.clear("short-answers")
    rig.until_ready()
    rig.until(rig.arrived(rig.move(0.02, 20)))


def test_a_slow_controller_is_told_and_moves_the_arm_no_faster(rig: Rig) -> None:
    rig.fake.inject("slow")
    rig.reading()
    begin = rig.q.copy()
    for tick in range(300):
        rig.write(begin + np.eye(7)[0] * 0.02 * tick / 300)
    rig.until(lambda: "answers late" in rig.message())
    assert rig.fake.controller.error == 0
    rig.fake.clear("slow")


def test_joints_that_are_no_numbers_are_not_taken(rig: Rig) -> None:
    rig.fake.inject("not-a-number")
    rig.until(lambda: rig.reading()[0] == Event.ARM_LOST)
    assert np.all(np.isfinite(rig.q))
    rig.fake.clear("not-a-number")
    rig.until_ready()


def test_an_arm_that_stands_outside_of_its_limits_is_not_ready(rig: Rig) -> None:
    controller = rig.fake.controller
    stood = controller.q.copy()
    controller.q[5] = controller.target[5] = limits()[1][5] + 0.05
    rig.until(lambda: rig.reading() == (Event.NOTHING, Readiness.OUTSIDE_LIMITS))
    assert rig.stands()
    controller.q[:] = controller.target[:] = stood
    rig.until_ready()


def test_a_controller_that_was_started_anew_waits_for_somebody(rig: Rig) -> None:
    rig.fake.inject("unplugged")
    rig.until(lambda: rig.reading()[0] == Event.ARM_LOST)
    rig.fake.controller.mode, rig.fake.controller.state = 0, 4
    rig.fake.clear("unplugged")
    rig.until(lambda: rig.reading() == (Event.NOTHING, Readiness.TORQUE_OFF))
    assert "take hold" in rig.message()
    assert rig.stands()


def test_a_release_that_did_not_get_through_is_made_up_for(rig: Rig) -> None:
    rig.fake.inject("unplugged")
    rig.until(lambda: rig.reading()[0] == Event.ARM_LOST)
    rig.arm.release()
    rig.fake.clear("unplugged")
    rig.until(lambda: not rig.fake.controller.enabled)
    rig.until(lambda: rig.reading() == (Event.NOTHING, Readiness.TORQUE_OFF))


def test_closing_leaves_it_under_torque(shared: Rig) -> None:
    shared.arm.recover()
    shared.until_ready()
    shared.move(0.02, 20)
    shared.arm.close()
    controller = shared.fake.controller
    assert (controller.state, controller.enabled) == (4, True)
    shared.until(lambda: shared.fake.state()["clients"] == 0)


def test_without_the_library_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarm.wrapper", None)
    with pytest.raises(ArmLibraryMissing, match=r"keyhole\[xarm\]"):
        XArm(to_fake())
