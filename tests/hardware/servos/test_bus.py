"""The driver's transactions against the servo simulator, on a pseudo-terminal."""

from __future__ import annotations

import os
import pty
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hardware.fake_servos.client import FakeServosProcess
from hardware.servos.bus import ServoBus
from hardware.servos.control_table import PRESENT, TABLE, OperatingMode
from hardware.servos.cyclic import ALL, CyclicExchange
from hardware.servos.errors import PortLost, PortMissing, ServoRefused, ServoSilent
from hardware.servos.port import SerialPort, candidates
from hardware.servos.protocol import BROADCAST, StatusError

IDS = (101, 102, 103, 104)
SIZE = PRESENT[1] - PRESENT[0]
PATIENT_S = 1.0


@pytest.fixture(scope="module")
def simulator(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeServosProcess]:
    link = tmp_path_factory.mktemp("bus") / "ttyFAKE0"
    with FakeServosProcess(link) as process:
        yield process


@pytest.fixture
def bus(simulator: FakeServosProcess) -> Iterator[ServoBus]:
    simulator.servos.clear()
    port = SerialPort(str(simulator.link), 1_000_000)
    yield ServoBus(port, PATIENT_S)
    port.close()


def test_servos_say_who_they_are(bus: ServoBus) -> None:
    found = bus.broadcast_ping(until=110)
    assert [servo.id for servo in found] == list(IDS)
    assert found == [bus.ping(servo) for servo in IDS]
    assert {servo.model for servo in found} == {1060}


def test_what_is_written_is_read(bus: ServoBus) -> None:
    bus.write(101, "profile_velocity", 87)
    assert bus.read(101, "profile_velocity") == 87
    bus.sync_write("profile_velocity", [(servo, servo) for servo in IDS])
    assert [bus.read(servo, "profile_velocity") for servo in IDS] == list(IDS)
    assert bus.read(102, "operating_mode") == OperatingMode.POSITION


def test_bytes_that_have_to_be_stuffed_arrive(bus: ServoBus) -> None:
    address = TABLE["indirect_data_1"].address
    data = b"\xff\xff\xfd\xff\xff\xfd\xfd\x00"
    bus.write_bytes(103, address, data)
    assert bus.read_bytes(103, address, len(data)).data == data


def test_both_sync_reads_say_the_same(bus: ServoBus) -> None:
    plain = bus.sync_read(PRESENT[0], SIZE, IDS)
    fast = bus.fast_sync_read(PRESENT[0], SIZE, IDS)
    assert [block.id for block in plain] == list(IDS)
    assert [block.data[6:10] for block in plain] == [block.data[6:10] for block in fast]


@pytest.mark.parametrize("fast", [True, False])
def test_a_cycle_writes_goals_and_reads_them_followed(bus: ServoBus, fast: bool) -> None:
    for servo in IDS:
        bus.write(servo, "torque_enable", 1)
    cycle = CyclicExchange(bus, IDS, fast, PATIENT_S)
    goals = [2048, 2060, 2100, 1990] if fast else [2058, 2050, 2090, 2000]
    end = time.monotonic() + 20.0
    answered = 0
    while max(abs(a - b) for a, b in zip(cycle.position, goals, strict=True)) > 12:
        assert time.monotonic() < end, cycle.position
        answered = cycle.exchange(goals)
        time.sleep(0.005)
    assert answered == ALL
    assert all(100 < volt < 130 for volt in cycle.voltage)
    assert all(20 < celsius < 60 for celsius in cycle.temperature)
    for servo in IDS:
        bus.write(servo, "torque_enable", 0)


def test_a_refusal_says_who_refused_what(bus: ServoBus) -> None:
    with pytest.raises(ServoRefused, match="servo 102 refused to write model_number") as raised:
        bus.write(102, "model_number", 1)
    assert raised.value.error == StatusError.ACCESS


def test_somebody_who_is_not_there_is_silent(simulator: FakeServosProcess) -> None:
    port = SerialPort(str(simulator.link), 1_000_000)
    bus = ServoBus(port)
    with pytest.raises(ServoSilent, match="servo 7 did not answer"):
        bus.ping(7)
    assert bus.counters.missed == 2
    port.close()


def test_at_another_speed_nobody_hears(simulator: FakeServosProcess) -> None:
    port = SerialPort(str(simulator.link), 57_600)
    with pytest.raises(ServoSilent):
        ServoBus(port).ping(101)
    port.close()


@pytest.mark.parametrize("fault", ["crc-flip", "truncated", "wrong-id", "timeouts"])
def test_a_transaction_survives_one_bad_answer(
    simulator: FakeServosProcess, bus: ServoBus, fault: str
) -> None:
    patient = ServoBus(bus.port, 0.1)
    simulator.servos.inject(fault, times=1)
    assert patient.ping(104, tries=5).id == 104
    counters = patient.counters
    assert counters.missed + counters.damaged + counters.strays > 0


def test_an_unconfirmed_write_reaches_all(bus: ServoBus) -> None:
    bus.write_unconfirmed(BROADCAST, "led", 1)
    assert [bus.read(servo, "led") for servo in IDS] == [1] * 4


def test_a_reboot_forgets_what_is_not_kept(bus: ServoBus) -> None:
    bus.write(101, "led", 1)
    bus.reboot(101)
    assert bus.ping(101, tries=5).id == 101
    assert bus.read(101, "led") == 0


def test_a_port_is_ours_alone(simulator: FakeServosProcess, bus: ServoBus) -> None:
    with pytest.raises(PortMissing, match="cannot be opened"):
        SerialPort(str(simulator.link), 1_000_000)
    with pytest.raises(PortMissing, match="keyhole doctor"):
        SerialPort("/dev/there-is-none", 1_000_000)


def test_a_port_that_hangs_up_says_so() -> None:
    master, slave = pty.openpty()
    port = SerialPort(os.ttyname(slave), 1_000_000)
    os.close(slave)
    os.close(master)

    def use() -> None:
        for _ in range(10):
            port.write(b"x")
            port.wait(time.monotonic_ns() + 1_000_000)
            port.discard()

    with pytest.raises(PortLost, match="went away"):
        use()
    port.close()


def test_candidates_follow_patterns_and_name_each_device_once(tmp_path: Path) -> None:
    for name in ("ttyFAKE0", "ttyFAKE1"):
        (tmp_path / name).touch()
    (tmp_path / "ttyFAKE2").symlink_to(tmp_path / "ttyFAKE0")
    pattern = str(tmp_path / "ttyFAKE*")
    assert candidates(pattern) == [str(tmp_path / "ttyFAKE0"), str(tmp_path / "ttyFAKE1")]
    assert candidates(str(tmp_path / "ttyFAKE1")) == [str(tmp_path / "ttyFAKE1")]
    assert candidates(str(tmp_path / "none")) == []
