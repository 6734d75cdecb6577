"""Servos that switched themselves off are started anew, whatever the wire loses of that."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hardware.fake_servos.client import FakeServosProcess
from hardware.module.preparation import read_status, reboot_all
from hardware.servos.bus import ServoBus
from hardware.servos.errors import ServoSilent
from hardware.servos.port import SerialPort

IDS = (101, 102, 103, 104)


class LossyBus(ServoBus):
    """Loses the first ``lost`` instructions to start anew, or the answers to them."""

    lost = 0
    loses_answers = False

    def reboot(self, servo: int) -> None:
        if self.lost:
            self.lost -= 1
            if self.loses_answers:
                super().reboot(servo)
            raise ServoSilent("the port", servo, 0.01)
        super().reboot(servo)


@pytest.fixture
def overloaded(tmp_path: Path) -> Iterator[LossyBus]:
    """A bus on which servo 103 has switched itself off."""
    with FakeServosProcess(tmp_path / "ttyFAKE0") as simulator:
        port = SerialPort(str(simulator.link), 1_000_000)
        bus = LossyBus(port, 1.0)
        simulator.servos.inject("overload", servo=103)
        ends = time.monotonic() + 10.0
        while not read_status(bus, 103).error:
            assert time.monotonic() < ends
            time.sleep(0.05)
        simulator.servos.clear()
        assert read_status(bus, 103).error
        yield bus
        port.close()


@pytest.mark.parametrize(("lost", "loses_answers"), [(0, False), (1, True), (1, False), (2, False)])
def test_a_servo_is_started_anew_though_packets_are_lost(
    overloaded: LossyBus, lost: int, loses_answers: bool
) -> None:
    overloaded.lost, overloaded.loses_answers = lost, loses_answers
    reboot_all(overloaded, IDS)
    assert not any(read_status(overloaded, servo).error for servo in IDS)
    assert overloaded.lost == 0
