"""The instrument module against simulated servos: homing, following, holding, letting go."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hardware.devices import DeviceState
from hardware.fake_servos.client import FakeServosProcess
from hardware.module.module import InstrumentModule
from robot.records import Readiness
from robot.safety import Event
from tests.hardware.module.bench import BUS_PATIENCE_S, IDS, Bench, bench, settings


@pytest.fixture(scope="module")
def shared() -> Iterator[Bench]:
    """Of this file's own: a segment that no fault has bent."""
    with bench() as made:
        made.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
        yield made


def test_homing_leaves_every_tendon_taut_and_the_segment_nearly_straight(homed: Bench) -> None:
    state = homed.servos.state()
    assert min(state["tensions_n"]) > 10.0
    # Unequal slack of the tendons is all that bends it.
    assert max(abs(bend) for bend in state["bend_rad"]) < math.radians(12.0)
    homed.read()
    assert np.all(homed.loads < -0.05)


def test_a_motion_is_followed_and_bends_the_segment_the_right_way(homed: Bench) -> None:
    before = homed.servos.state()["bend_rad"]
    homed.drive_to((-0.3, 0.0, 0.3, 0.0))
    after = homed.servos.state()["bend_rad"]
    # A pulled first tendon bends toward +u; the tendons' share is pulley over pitch radius.
    assert after[0] - before[0] > 0.5
    assert abs(after[1] - before[1]) < 0.1


def test_homing_again_from_a_bend_finds_straight_again(homed: Bench) -> None:
    homed.drive_to((-0.2, 0.0, 0.2, 0.0))
    assert homed.servos.state()["bend_rad"][0] > 0.3
    homed.rest()
    homed.home()
    homed.ready()
    assert max(abs(bend) for bend in homed.servos.state()["bend_rad"]) < math.radians(12.0)


def test_what_is_not_a_motion_is_not_followed(homed: Bench) -> None:
    goals = homed.goals()
    homed.command[:] += 0.2
    homed.rest(0.2)
    assert homed.goals() == goals


def test_a_motion_that_does_not_begin_where_the_servos_are_is_not_followed(homed: Bench) -> None:
    homed.module.hold()
    homed.rest(0.1)
    goals = homed.goals()
    homed.insist(homed.command + 0.2)
    assert homed.goals() == goals
    assert "does not begin where the servos are" in homed.message


def test_hold_stops_and_ignores_the_motion_that_goes_on(homed: Bench) -> None:
    homed.drive_to((0.1, 0.0, -0.1, 0.0))
    homed.module.hold()
    homed.insist(homed.command)
    goals = homed.goals()
    homed.insist(homed.command + 0.05)
    assert homed.goals() == goals


def test_release_lets_go_and_who_takes_hold_again_must_home(homed: Bench) -> None:
    homed.module.release()
    homed.until(lambda reading: reading.readiness == Readiness.TORQUE_OFF)
    assert not any(servo["torque"] for servo in homed.servos.state()["servos"])
    homed.rest(0.3)
    homed.module.take_hold()
    # Tendons under pretension turn their servos back: without it the zero means nothing.
    homed.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
    assert all(servo["torque"] for servo in homed.servos.state()["servos"])
    assert "slack" in homed.message


def test_people_are_told_about_the_bus(homed: Bench) -> None:
    homed.until(lambda _: homed.devices()["rate_hz"] > 0.0)
    bus = homed.devices()
    assert bus["state"] == DeviceState.CONNECTED
    assert bus["homed"] == 1
    assert tuple(bus["servos"]["id"]) == IDS
    assert set(bus["servos"]["model"]) == {1060}
    assert all(bus["servos"]["answers"])
    assert all(abs(bus["servos"]["voltage_v"] - 12.0) < 1.0)
    assert 0.0 < bus["cycle_median_ms"] <= bus["cycle_p99_ms"]
    assert 0.0 < bus["cpu_percent"] < 100.0
    assert bus["port"].decode().endswith("ttyFAKE0")


def test_a_wrong_sign_is_found_at_homing() -> None:
    with bench("--faults", "reversed:servo=102") as made:
        made.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
        assert made.home().startswith("servo 102: turns the wrong way")
        assert made.read().readiness == Readiness.NOT_HOMED


def test_tendons_in_the_wrong_order_are_found_at_homing() -> None:
    with bench("--ids", "102,101,103,104") as made:
        made.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
        assert made.home().startswith("servo 101: pulling it loads 104 rather than 103")


def test_a_slack_tendon_is_found_at_homing() -> None:
    with bench("--slack-mm", "0.8,1.2,30,0.6", homing_range_deg=60.0) as made:
        made.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
        assert "not taut after 60 deg" in made.home()


def test_the_zero_outlives_the_host_but_not_the_servos_power(tmp_path: Path) -> None:
    link = tmp_path / "ttyFAKE0"
    with FakeServosProcess(link) as process:
        for homed_before in (False, True):
            module = InstrumentModule(settings(link), BUS_PATIENCE_S)
            made = Bench(module, process.servos)
            made.until(lambda reading: reading.readiness != Readiness.NOT_CONNECTED)
            assert (made.read().readiness == Readiness.READY) == homed_before
            made.ready()
            assert np.all(np.abs(made.angles) < math.radians(6.0))
            if not homed_before:
                module.close()
    try:
        made.until(lambda reading: reading.event == Event.BUS_LOST)
        with FakeServosProcess(link):
            made.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
            assert "lost their torque" in made.message
    finally:
        module.close()


def test_servos_of_the_factory_are_set_up_without_touching_their_torque() -> None:
    with bench("--return-delay-us", "500") as made:
        made.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
        state = made.servos.state()["servos"]
        assert not any(servo["torque"] for servo in state)
        assert {servo["operating_mode"] for servo in state} == {3}
        assert {servo["bus_watchdog"] for servo in state} == {100}
