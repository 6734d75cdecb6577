"""Every fault of the bus: noticed, told, held; nothing moves again by itself."""

from __future__ import annotations

import time

import numpy as np
import pytest

from robot.records import Readiness
from robot.safety import Event
from tests.hardware.module.bench import Bench


def _holds(made: Bench) -> None:
    """The old motion may go on and changes nothing.

    A servo that has let go is left out: prepared again after a gap, it is told where it sags to.
    """
    settled = time.monotonic() + 0.05
    made.moving_until(lambda _: time.monotonic() > settled)
    goals = _held(made)
    end = settled + 0.15
    made.moving_until(lambda _: time.monotonic() > end)
    assert _held(made) == goals


def _held(made: Bench) -> dict[int, int]:
    servos = made.servos.state()["servos"]
    return {servo["id"]: servo["goal"] for servo in servos if servo["torque"]}


@pytest.mark.parametrize("fault", ["crc-flip", "truncated", "wrong-id", "duplicate", "late"])
def test_one_bad_answer_is_counted_and_not_used(homed: Bench, fault: str) -> None:
    before = homed.devices()
    counted = before["missed"] + before["bad_packets"]

    def told() -> bool:
        bus = homed.devices()
        return bool(bus["missed"] + bus["bad_packets"] > counted)

    for _ in range(10):
        # It may strike a servo's status beside the cycle, which is just asked for again.
        homed.servos.inject(fault, **({"delay_ms": 500.0} if fault == "late" else {}))
        begin = time.monotonic()

        def told_or_late(_: object, begin: float = begin) -> bool:
            return told() or time.monotonic() > begin + 2.0

        homed.moving_until(told_or_late)
        if told():
            break
    assert told()
    homed.moving_until(lambda reading: reading.age_s < 0.05)
    assert np.abs(homed.angles).max() < 0.5, "no value out of a bad answer"


def test_a_burst_of_missing_answers_is_an_event_and_passes(homed: Bench) -> None:
    homed.servos.inject("timeouts", times=6)
    homed.moving_until(lambda reading: reading.event == Event.SERVO_SILENT)
    assert homed.read().readiness == Readiness.DEVICE_FAULT
    homed.moving_until(lambda reading: reading.event == 0)
    assert homed.read().readiness == Readiness.READY
    _holds(homed)


@pytest.mark.parametrize(
    ("fault", "value", "words"),
    [
        ("overheat", 70.0, "70 °C, above"),
        ("voltage", 8.0, "8.0 V, outside"),
    ],
)
def test_a_servo_in_trouble_is_named_with_what_to_do(
    homed: Bench, fault: str, value: float, words: str
) -> None:
    homed.servos.inject(fault, servo=103, value=value)
    homed.moving_until(lambda reading: reading.event == Event.SERVO_FAULT)
    homed.moving_until(lambda _: words in homed.message)
    assert homed.message.startswith("servo 103: ")
    assert homed.read().readiness == Readiness.DEVICE_FAULT
    _holds(homed)


def test_an_encoder_that_is_stuck_is_found_when_the_servo_should_move(homed: Bench) -> None:
    homed.servos.inject("encoder-stuck", servo=101)
    homed.moving_until(lambda reading: reading.event == Event.SERVO_FAULT)
    assert homed.message.startswith("servo 101: ")
    assert "stands still" in homed.message


@pytest.mark.parametrize("fault", ["unplug-reading", "unplug-writing", "unplug"])
def test_a_bus_that_is_gone_is_found_again_and_holds(homed: Bench, fault: str) -> None:
    homed.servos.inject(fault)
    homed.moving_until(lambda reading: reading.event == Event.BUS_LOST)
    assert homed.read().readiness == Readiness.NOT_CONNECTED
    homed.servos.replug()
    homed.moving_until(lambda reading: reading.readiness == Readiness.READY)
    assert homed.read().event == 0
    assert homed.devices()["reconnects"] > 0
    _holds(homed)


def test_a_bus_under_another_name_is_the_same_bus(homed: Bench) -> None:
    homed.servos.inject("another-name")
    homed.moving_until(lambda reading: reading.event == Event.BUS_LOST)
    homed.moving_until(lambda reading: reading.readiness == Readiness.READY)
    assert not homed.devices()["port"].decode().endswith("ttyFAKE0")
    _holds(homed)
    homed.servos.unplug()
    homed.servos.replug("ttyFAKE0")


def test_an_overloaded_servo_is_started_anew_and_the_module_homed(homed: Bench) -> None:
    homed.servos.inject("overload", servo=103)
    homed.moving_until(lambda reading: reading.event == Event.SERVO_FAULT)
    homed.moving_until(lambda _: "servo 103: overload, torque is off" in homed.message)
    assert homed.devices()["servos"]["hardware_error"][2] == 32
    _holds(homed)
    homed.servos.clear()
    homed.module.reboot()
    homed.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
    assert homed.devices()["servos"]["hardware_error"][2] == 0


def test_a_silent_servo_is_named_and_a_release_reaches_the_others(homed: Bench) -> None:
    homed.servos.inject("silent", servo=102)
    homed.moving_until(lambda reading: reading.event == Event.SERVO_SILENT)
    assert homed.message.startswith("servo 102 does not answer")
    assert not homed.read().valid
    homed.module.release()
    homed.until(lambda _: "servo 102 did not confirm" in homed.message)
    torques = {servo["id"]: servo["torque"] for servo in homed.servos.state()["servos"]}
    assert not any(torques[servo] for servo in (101, 103, 104))
