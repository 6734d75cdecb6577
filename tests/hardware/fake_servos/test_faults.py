"""Every fault by its name: what the host sees of it, how often, and when it is over."""

from __future__ import annotations

import pytest

from hardware.control_channel import BadFault
from hardware.fake_servos.faults import KNOWN, Faults, Kind, make, parse
from hardware.servos.protocol import (
    BROADCAST,
    Instruction,
    PacketReader,
    fast_status_blocks,
    instruction_packet,
    sync_read_parameters,
)
from robot.errors import UnknownName
from tests.hardware.fake_servos.wire_host import IDS, WireHost

PING = instruction_packet(101, Instruction.PING)
FAST = instruction_packet(BROADCAST, Instruction.FAST_SYNC_READ, sync_read_parameters(126, 21, IDS))
REPLIES = sorted(name for name, known in KNOWN.items() if known.kind is Kind.REPLY)


def _heard(host: WireHost, data: bytes) -> tuple[int, int, bool]:
    """Good packets or blocks, bytes, and whether the port hung up."""
    outgoing = host.raw(data)
    stream = b"".join(sent.data for sent in outgoing)
    good = (
        len(fast_status_blocks(stream, 21))
        if data == FAST
        else sum(packet.id == 101 for packet in PacketReader().feed(stream))
    )
    return good, len(stream), any(sent.unplug for sent in outgoing)


@pytest.mark.parametrize(
    ("name", "ping", "fast"),
    [
        ("crc-flip", (0, 14, False), (3, 108, False)),
        ("truncated", (0, 7, False), (3, 95, False)),
        ("wrong-id", (0, 14, False), (4, 108, False)),
        ("duplicate", (2, 28, False), (4, 216, False)),
        ("late", (1, 14, False), (4, 108, False)),
        ("timeouts", (0, 0, False), (0, 0, False)),
        ("unplug-reading", (0, 7, True), (3, 95, True)),
    ],
)
def test_what_a_fault_does_to_an_answer(
    name: str, ping: tuple[int, int, bool], fast: tuple[int, int, bool]
) -> None:
    for data, expected, good in ((PING, ping, (1, 14, False)), (FAST, fast, (4, 108, False))):
        host = WireHost(faults=f"{name}:times=2:after=1")
        assert _heard(host, data) == good
        assert [_heard(host, data) for _ in range(2)] == [expected] * 2
        assert _heard(host, data) == good
        (fault,) = host.faults.all
        assert (fault.acted, fault.over) == (2, True)
        assert 0 < fault.first_ns < fault.last_ns


def test_the_table_above_has_every_fault_of_an_answer() -> None:
    marks = test_what_a_fault_does_to_an_answer.pytestmark  # type: ignore[attr-defined]
    assert sorted(case[0] for case in marks[0].args[1]) == REPLIES


@pytest.mark.parametrize("servo", IDS)
def test_a_fault_strikes_the_servo_it_names(servo: int) -> None:
    host = WireHost(faults=f"wrong-id:servo={servo}")
    ids = [block.id for block in host.fast()]
    assert [number for number in IDS if number not in ids] == [servo]
    host = WireHost(faults=f"crc-flip:servo={servo}")
    assert [block.id for block in host.fast()] == list(IDS[: IDS.index(servo)])


def test_a_late_answer_is_late() -> None:
    on_time = WireHost().raw(PING)[0].due_ns
    late = WireHost(faults="late:delay_ms=7").raw(PING)[0].due_ns
    assert late - on_time == 7_000_000


def test_unplugged_while_writing_the_goal_never_reaches_a_servo() -> None:
    host = WireHost()
    host.drive()
    host.faults.add(make("unplug-writing", {}, IDS, host.now_ns))
    host.aim({101: 1000})
    assert not host.wire.goals
    assert host.faults.all[0].acted == 1


def test_until_cleared_means_for_ever() -> None:
    host = WireHost(faults="crc-flip:times=0")
    assert not any(_heard(host, PING)[0] for _ in range(30))
    assert host.faults.named("crc-flip")


def test_an_expired_fault_is_found() -> None:
    faults = Faults()
    faults.add(make("silent", {"for_ms": 50}, IDS, 0))
    assert not faults.expired(49_000_000)
    assert [fault.name for fault in faults.expired(50_000_000)] == ["silent"]


def test_many_faults_on_one_line() -> None:
    faults = parse("late:delay_ms=3:servo=102, silent ,crc-flip:times=4", IDS, 0)
    assert [(fault.name, fault.servo, fault.times) for fault in faults] == [
        ("late", 102, 1),
        ("silent", None, 0),
        ("crc-flip", None, 4),
    ]


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("crcflip", UnknownName, "choose one of: unplug"),
        ("late:servo=7", BadFault, "there is no servo 7"),
        ("late:speed=7", BadFault, "no option 'speed'"),
        ("late:times=x", BadFault, "is no number"),
        ("late:times=-1", BadFault, "must not be negative"),
        ("late:times", BadFault, "is not KEY=VALUE"),
    ],
)
def test_what_makes_no_sense_is_refused(text: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        parse(text, IDS, 0)
