"""The program on its pseudo-terminal: the vendor's SDK and plain system calls are its hosts."""

from __future__ import annotations

import errno
import os
import termios
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from dynamixel_sdk import (
    COMM_RX_TIMEOUT,
    COMM_SUCCESS,
    GroupSyncRead,
    GroupSyncWrite,
    PacketHandler,
    PortHandler,
)

from hardware.fake_servos.client import FakeServos, FakeServosFailed, FakeServosProcess
from hardware.fake_servos.faults import KNOWN, Kind
from hardware.fake_servos.program import control_path
from hardware.servos.protocol import Instruction, instruction_packet
from tests.hardware.fake_servos.wire_host import IDS

PING = instruction_packet(101, Instruction.PING)
HANDLER = PacketHandler(2.0)
PATIENT_MS = 2000.0
"""What an answer may take: the machine may be busy, and the vendor's library waits for 34 ms."""


class PatientPort(PortHandler):  # type: ignore[misc] # the library has no types
    """The vendor's port with a longer wait for answers.

    Attributes:
        patience_ms: how much longer.
    """

    patience_ms = PATIENT_MS

    def setPacketTimeout(self, packet_length: int) -> None:
        super().setPacketTimeout(packet_length)
        self.packet_timeout += self.patience_ms


def _nothing_comes(port: PatientPort, servo: int) -> bool:
    """Whether a ping has no answer in the vendor's own time."""
    port.patience_ms = 0.0
    result = HANDLER.ping(port, servo)[1]
    port.patience_ms = PATIENT_MS
    return bool(result == COMM_RX_TIMEOUT)


@pytest.fixture(scope="module")
def process(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeServosProcess]:
    link = tmp_path_factory.mktemp("fake") / "servos"
    with FakeServosProcess(link, "--slack-mm", "0,0,0,0") as running:
        yield running


@pytest.fixture
def fake(process: FakeServosProcess) -> Iterator[FakeServos]:
    yield process.servos
    process.servos.clear()
    process.servos.replug()


@pytest.fixture
def port(fake: FakeServos) -> Iterator[PatientPort]:
    opened = PatientPort(str(fake.link))
    assert opened.openPort()
    yield opened
    opened.closePort()


def _until(condition: Callable[[], object], seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.005)


def _open(path: Path) -> int:
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(descriptor)
    settings = termios.tcgetattr(descriptor)
    settings[4] = settings[5] = termios.B1000000
    termios.tcsetattr(descriptor, termios.TCSANOW, settings)
    os.set_blocking(descriptor, False)
    return descriptor


def test_the_vendors_library_pings_reads_and_writes(port: PatientPort) -> None:
    assert HANDLER.ping(port, 101) == (1060, COMM_SUCCESS, 0)
    assert _nothing_comes(port, 42)
    assert HANDLER.write1ByteTxRx(port, 102, 9, 10) == (COMM_SUCCESS, 0)
    assert HANDLER.read1ByteTxRx(port, 102, 9) == (10, COMM_SUCCESS, 0)
    assert HANDLER.write4ByteTxRx(port, 103, 116, 9999) == (COMM_SUCCESS, 6)
    assert HANDLER.write1ByteTxRx(port, 103, 132, 0)[1] == 7
    assert HANDLER.factoryReset(port, 104, 0xFF) == (COMM_SUCCESS, 1)
    assert HANDLER.regWriteTxRx(port, 104, 65, 1, [1]) == (COMM_SUCCESS, 0)
    assert HANDLER.action(port, 104) == COMM_SUCCESS


def test_the_vendors_library_finds_everybody(port: PatientPort) -> None:
    found, result = HANDLER.broadcastPing(port)
    assert result == COMM_SUCCESS
    assert found == {servo: [1060, 46] for servo in IDS}


@pytest.mark.parametrize("read", ["txRxPacket", "fastSyncRead"])
def test_the_vendors_library_drives_all_at_once(
    port: PatientPort, fake: FakeServos, read: str
) -> None:
    for servo in IDS:
        assert HANDLER.write1ByteTxRx(port, servo, 64, 1) == (COMM_SUCCESS, 0)
    goals = {servo: 1900 + servo for servo in IDS}
    group = GroupSyncWrite(port, HANDLER, 116, 4)
    for servo, goal in goals.items():
        group.addParam(servo, list(goal.to_bytes(4, "little")))
    begin_ns = time.monotonic_ns()
    assert group.txPacket() == COMM_SUCCESS
    _until(
        lambda: all(
            servo["velocity"] == 0.0 and abs(servo["ticks"] - goals[servo["id"]]) < 20
            for servo in fake.state()["servos"]
        )
    )
    reading = GroupSyncRead(port, HANDLER, 126, 21)
    for servo in IDS:
        reading.addParam(servo)
    assert getattr(reading, read)() == COMM_SUCCESS
    for servo, truth in zip(IDS, fake.state()["servos"], strict=True):
        assert reading.getData(servo, 132, 4) == pytest.approx(truth["ticks"], abs=2)
        assert reading.getData(servo, 144, 2) == 120
    received_ns, executed_ns, written = fake.goals(begin_ns)[-1]
    assert begin_ns < received_ns < executed_ns < time.monotonic_ns()
    assert dict(written) == goals
    first, *_, last = fake.positions(begin_ns)
    assert first[0] <= last[0]
    assert last[1] == pytest.approx([truth["ticks"] for truth in fake.state()["servos"]], abs=1)
    for servo in IDS:
        HANDLER.write1ByteTxRx(port, servo, 64, 0)


def test_at_another_speed_the_vendors_library_hears_nothing(port: PatientPort) -> None:
    port.setBaudRate(57_600)
    assert _nothing_comes(port, 101)
    port.setBaudRate(1_000_000)
    assert HANDLER.ping(port, 101)[1] == COMM_SUCCESS


def test_unplugged_the_port_hangs_up_and_its_name_is_gone(fake: FakeServos) -> None:
    descriptor = _open(fake.link)
    fake.unplug()
    assert not fake.link.is_symlink()
    with pytest.raises(OSError, match="Input/output error") as refused:
        os.write(descriptor, PING)
    assert refused.value.errno == errno.EIO
    os.close(descriptor)
    fake.replug("servos-elsewhere")
    descriptor = _open(fake.link.with_name("servos-elsewhere"))
    os.write(descriptor, PING)
    os.close(descriptor)


def test_unplugged_in_the_middle_of_an_answer(fake: FakeServos) -> None:
    descriptor = _open(fake.link)
    fake.inject("unplug-reading")
    os.write(descriptor, PING)
    _until(lambda: fake.state()["link"] is None)
    with pytest.raises(OSError, match="Input/output error"):
        os.write(descriptor, PING)
    os.close(descriptor)


def test_it_comes_back_under_another_name_by_itself(fake: FakeServos) -> None:
    stamp_ns = fake.inject("another-name", delay_ms=30)
    _until(lambda: fake.state()["link"] not in {None, str(fake.link)})
    link = Path(fake.state()["link"])
    assert link.is_symlink()
    assert link.parent == fake.link.parent
    assert time.monotonic_ns() - stamp_ns >= 30_000_000


@pytest.mark.parametrize(
    "name", [name for name, known in KNOWN.items() if known.kind is Kind.CONDITION]
)
def test_conditions_begin_and_end(fake: FakeServos, port: PatientPort, name: str) -> None:
    fake.inject(name, servo=102)
    if name == "silent":
        assert _nothing_comes(port, 102)
    else:
        assert HANDLER.ping(port, 102)[1] == COMM_SUCCESS
    (fault,) = [entry for entry in fake.state()["faults"] if not entry["over"]]
    assert (fault["name"], fault["servo"], fault["acted"]) == (name, 102, 1)
    fake.clear(name)
    assert HANDLER.ping(port, 102)[1] == COMM_SUCCESS
    assert HANDLER.reboot(port, 102)[0] == COMM_SUCCESS
    # While it boots it is deaf.
    _until(lambda: not _nothing_comes(port, 102))
    assert HANDLER.ping(port, 102)[1:] == (COMM_SUCCESS, 0)


def test_a_condition_ends_when_its_time_is_over(fake: FakeServos) -> None:
    fake.inject("silent", servo=104, for_ms=20)
    _until(lambda: all(entry["over"] for entry in fake.state()["faults"]))


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"inject": "nothing"}, "unknown fault"),
        ({"inject": "late", "servo": 1}, "there is no servo 1"),
        ({"dance": True}, "send one of: inject"),
        ({"goals": True, "since_ns": "yesterday"}, "bad_value"),
        ({"replug": "no/such/folder"}, "bad_value"),
    ],
)
def test_bad_requests_are_refused(
    fake: FakeServos, request_: dict[str, object], words: str
) -> None:
    with pytest.raises(FakeServosFailed, match=words):
        fake.ask(**request_)
    assert fake.state()["ok"]


def test_it_sleeps_while_nothing_happens(fake: FakeServos) -> None:
    before = fake.state()["cpu_s"]
    time.sleep(0.5)
    assert fake.state()["cpu_s"] - before < 0.1


def test_it_tidies_up_behind_itself(tmp_path: Path) -> None:
    link = tmp_path / "own"
    with FakeServosProcess(link, "--ids", "1,2", "--faults", "silent:servo=2") as running:
        assert [servo["id"] for servo in running.servos.state()["servos"]] == [1, 2]
        assert control_path(link).exists()
    assert not link.is_symlink()
    assert not control_path(link).exists()
