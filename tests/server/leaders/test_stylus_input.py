"""Every fault of a stylus ends at its input: what control gets to see of it."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from robot.configuration import Stylus
from robot.records import INSTRUMENT, DriveMode, Safety
from server.leaders.control_view import ControlView
from server.leaders.stylus_input import StylusInput
from tests.server.leaders.conftest import ControlSide

HERE = (0.01, -0.02, 0.03)
TURNED = (0.5, 0.5, -0.5, 0.5)
MS = 1_000_000


class Device:
    """A stylus that sends a sample every 2 ms, its buttons with each; a clock of its own."""

    def __init__(self, stylus: StylusInput) -> None:
        self.stylus, self.now = stylus, time.monotonic_ns()
        self.bits, self.enabled = 0, True

    def send(
        self,
        position: tuple[float, float, float] = HERE,
        wxyz: tuple[float, float, float, float] = TURNED,
        *,
        buttons: bool = True,
        stamp_ns: int | None = None,
    ) -> bool:
        """One sample; whether it was published."""
        self.now += 2 * MS
        stamp = self.now if stamp_ns is None else stamp_ns
        if buttons:
            self.stylus.take_buttons(self.bits, self.now, self.now)
        self.stylus.take_pose(position, wxyz, stamp, self.now)
        return self.stylus.publish(self.now, self.enabled)

    def lead(self) -> Device:
        """Let go, then press, as a hand does."""
        self.bits = 0
        self.send()
        self.bits = 1
        for _ in range(5):
            self.send()
        return self


@pytest.fixture
def device(stylus: StylusInput) -> Device:
    return Device(stylus).lead()


def test_a_sample_reaches_control(device: Device, control: ControlSide) -> None:
    sample = control.sample()
    assert sample["clutch"] == 1
    assert sample["absolute"] == 0
    assert sample["mode"] == DriveMode.BOTH
    assert sample["timeout_s"] == 0.025
    assert np.array(sample["position"]) == pytest.approx(HERE)
    assert np.array(sample["wxyz"]) == pytest.approx(TURNED)
    assert sample["sequence"] == device.now
    assert control.stamp_ns() == device.now


@pytest.mark.parametrize(("bits", "mode"), [(1, "BOTH"), (2, "SEGMENT"), (3, "ARM")])
def test_buttons_choose_what_moves(
    device: Device, control: ControlSide, bits: int, mode: str
) -> None:
    device.bits = bits
    device.send()
    assert (control.sample()["clutch"], control.sample()["mode"]) == (1, DriveMode[mode])
    device.bits = 0
    device.send()
    assert control.sample()["clutch"] == 0


def test_letting_go_needs_no_pose(device: Device, control: ControlSide) -> None:
    device.stylus.take_buttons(0, device.now + MS, device.now + MS)
    assert device.stylus.publish(device.now + MS, True)
    assert control.sample()["clutch"] == 0


@pytest.mark.parametrize(
    "position",
    [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, -math.inf), (25.0, 0, 0)],
)
def test_a_pose_that_is_none_is_told_while_it_leads(
    device: Device, control: ControlSide, position: tuple[float, float, float]
) -> None:
    assert not device.send(position)
    assert device.stylus.counts.invalid == 1
    sample = control.sample()
    assert sample["clutch"] == 1
    assert np.isnan(sample["position"]).all()
    # Good poses that follow must not hide it before control has paused.
    assert not device.send()
    device.enabled = False
    assert device.send()
    assert control.sample()["clutch"] == 0
    device.enabled = True
    device.send()
    assert control.sample()["clutch"] == 0, "the button was never let go"
    device.lead()
    assert control.sample()["clutch"] == 1


def test_a_zero_quaternion_is_told_too(device: Device, control: ControlSide) -> None:
    device.send(HERE, (0.0, 0.0, 0.0, 0.0))
    assert device.stylus.counts.invalid == 1
    assert np.isnan(control.sample()["position"]).all()


def test_a_pose_that_is_none_is_only_counted_while_nothing_is_pressed(
    device: Device, control: ControlSide
) -> None:
    device.bits = 0
    device.send()
    published = control.published
    device.send((math.nan, 0.0, 0.0))
    assert control.published == published
    assert device.stylus.counts.invalid == 1


def test_q_and_minus_q_are_the_same(device: Device, control: ControlSide) -> None:
    for sign in (1.0, -1.0, 1.0, -1.0):
        a, b, c, d = TURNED
        assert device.send(HERE, (sign * a, sign * b, sign * c, sign * d))
    assert device.stylus.counts.invalid == 0
    assert abs(float(np.array(control.sample()["wxyz"]) @ np.array(TURNED))) == pytest.approx(1.0)


@pytest.mark.parametrize(("back_ms", "name"), [(0, "repeated"), (20, "out_of_order")])
def test_a_sample_that_is_not_new_is_dropped(
    device: Device, control: ControlSide, back_ms: int, name: str
) -> None:
    newest, published = device.now, control.published
    assert not device.send((9.0, 9.0, 9.0), stamp_ns=newest - back_ms * MS)
    assert getattr(device.stylus.counts, name) == 1
    assert control.published == published
    assert control.stamp_ns() == newest, "its age goes on from the last good one"


def test_a_delayed_sample_is_as_old_as_it_is(device: Device, control: ControlSide) -> None:
    device.send(stamp_ns=device.now + 2 * MS - 90 * MS + 90 * MS)
    device.now += 90 * MS
    device.send(stamp_ns=device.now + 2 * MS - 90 * MS)
    assert control.stamp_ns() == device.now - 90 * MS
    assert device.stylus.counts.late == 1


def test_dead_buttons_make_the_sample_old(device: Device, control: ControlSide) -> None:
    heard = device.now
    for _ in range(10):
        device.send(buttons=False)
        assert control.stamp_ns() == device.now
    # The first that is old by the buttons is not yet older than the time-out; one comes soon.
    for _ in range(4):
        device.send(buttons=False)
    assert device.now - control.stamp_ns() > 25 * MS
    sample = control.sample()
    assert (sample["clutch"], control.stamp_ns()) == (1, heard)
    assert device.stylus.counts.buttons_dead == 1
    device.enabled = False
    device.send(buttons=False)
    assert control.sample()["clutch"] == 0
    device.enabled = True
    device.send(buttons=False)
    assert control.sample()["clutch"] == 0
    assert "press again" in device.stylus.why_not


def test_a_press_counts_only_where_it_begins_while_enabled(
    device: Device, control: ControlSide
) -> None:
    device.enabled = False
    device.send()
    assert control.sample()["clutch"] == 0
    device.enabled = True
    for _ in range(10):
        device.send()
    assert control.sample()["clutch"] == 0
    assert "let go" in device.stylus.why_not
    device.lead()
    assert control.sample()["clutch"] == 1
    assert device.stylus.why_not == ""


def test_a_new_connection_begins_disengaged(device: Device, control: ControlSide) -> None:
    device.stylus.connected(device.now)
    for _ in range(10):
        device.send()
    assert control.sample()["clutch"] == 0
    device.lead()
    assert control.sample()["clutch"] == 1


def test_a_driver_that_tells_changes_leads_with_its_first_press(
    stylus: StylusInput, control: ControlSide
) -> None:
    device = Device(stylus)
    device.send(buttons=False)
    device.bits = 1
    device.send()
    assert control.sample()["clutch"] == 1
    for _ in range(1000):
        device.send(buttons=False)
    assert control.sample()["clutch"] == 1
    assert stylus.counts.buttons_dead == 0


@pytest.mark.parametrize(
    ("safety", "age_s", "lives", "enabled"),
    [
        (Safety.ENABLED, 0.0, True, True),
        (Safety.PAUSED, 0.0, True, False),
        (Safety.ENABLED, 0.2, False, False),
        (None, 0.0, False, False),
    ],
)
def test_what_is_known_of_control(
    control: ControlSide, safety: Safety | None, age_s: float, lives: bool, enabled: bool
) -> None:
    view = ControlView(control.directory, INSTRUMENT)
    if safety is not None:
        control.say(safety, age_s=age_s)
    view.update(time.monotonic_ns())
    assert (view.lives, view.enabled) == (lives, enabled)
    view.close()


def test_a_stylus_is_silent_after_25_ms(stylus_configuration: Stylus) -> None:
    assert stylus_configuration.timeout_ms == 25.0
