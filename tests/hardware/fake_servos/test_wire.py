"""What goes over the wire, byte by byte and in its time."""

from __future__ import annotations

import numpy as np
import pytest
from dynamixel_sdk.protocol2_packet_handler import Protocol2PacketHandler

from hardware.fake_servos.servo import BOOT_NS
from hardware.servos.control_table import PRESENT, TABLE, HardwareError
from hardware.servos.protocol import (
    ALERT,
    BROADCAST,
    Instruction,
    StatusError,
    fast_status_blocks,
    instruction_packet,
    read_parameters,
    sync_read_parameters,
    write_parameters,
)
from tests.hardware.fake_servos.wire_host import IDS, WireHost


@pytest.fixture
def host() -> WireHost:
    return WireHost()


def test_a_ping_is_answered_as_the_manual_prints_it(host: WireHost) -> None:
    servo = host.simulation.servos[0]
    servo.registers["id"] = 1
    servo.registers["model_number"], servo.registers["firmware_version"] = 1030, 38
    (sent,) = host.raw(bytes.fromhex("fffffd00010300011" + "94e"))
    assert sent.data == bytes.fromhex("fffffd000107005500060426655d")


def test_everybody_answers_a_ping_of_all_in_the_order_of_ids(host: WireHost) -> None:
    answers = host.send(BROADCAST, Instruction.PING)
    assert [answer.id for answer in answers] == list(IDS)


def test_every_register_reads_what_was_written(host: WireHost, rng: np.random.Generator) -> None:
    """All registers that can be written, at random numbers of their range."""
    special = {"id", "baud_rate", "operating_mode", "torque_enable", "status_return_level"}
    limits = {"min_position_limit", "max_position_limit", "velocity_limit", "pwm_limit"}
    skipped = special | limits | {"goal_pwm", "goal_velocity", "goal_position", "protocol_type"}
    for register in TABLE.values():
        if register.access == "rw" and register.name not in skipped and register.address < 224:
            if register.name.startswith("indirect"):
                continue
            value = int(rng.integers(register.minimum, register.maximum + 1))
            assert host.write(102, register.name, value) == 0, register.name
            assert host.read(102, register.name) == value, register.name


@pytest.mark.parametrize(
    ("address", "data", "error"),
    [
        (132, b"\0\0\0\0", StatusError.ACCESS),
        (8, b"\x08", StatusError.DATA_RANGE),
        (11, b"\x07", StatusError.DATA_RANGE),
        (116, b"\0\0", StatusError.DATA_LENGTH),
        (117, b"\0", StatusError.DATA_LENGTH),
        (116, (5000).to_bytes(4, "little"), StatusError.DATA_LIMIT),
        (104, (300).to_bytes(4, "little"), StatusError.DATA_LIMIT),
        (14, b"\0", StatusError.ACCESS),
        (700, b"\0", StatusError.ACCESS),
        (112, (50).to_bytes(4, "little") + (2000).to_bytes(4, "little"), StatusError.NONE),
        (112, (50).to_bytes(4, "little") + (9000).to_bytes(4, "little"), StatusError.DATA_LIMIT),
    ],
)
def test_a_write_is_refused_for_the_right_reason_and_then_changes_nothing(
    host: WireHost, address: int, data: bytes, error: StatusError
) -> None:
    before = bytes(host.simulation.servos[0].registers.memory)
    (answer,) = host.send(101, Instruction.WRITE, write_parameters(address, data))
    assert answer.error == error
    assert (bytes(host.simulation.servos[0].registers.memory) == before) == bool(error)


def test_what_is_kept_without_power_is_locked_under_torque(host: WireHost) -> None:
    host.write(101, "torque_enable", 1)
    assert host.write(101, "return_delay_time", 0) == StatusError.ACCESS
    host.write(101, "torque_enable", 0)
    assert host.write(101, "return_delay_time", 0) == 0


@pytest.mark.parametrize(("level", "answered"), [(0, [1]), (1, [1, 2]), (2, [1, 2, 3, 8])])
def test_the_return_level_decides_who_is_answered(
    host: WireHost, level: int, answered: list[int]
) -> None:
    host.write(101, "status_return_level", level)
    parameters = {2: read_parameters(132, 4), 3: write_parameters(65, b"\x01"), 1: b"", 8: b""}
    heard = [kind for kind in (1, 2, 3, 8) if host.send(101, kind, parameters[kind])]
    assert heard == answered


def test_registered_writes_wait_for_the_action(host: WireHost) -> None:
    assert host.send(101, Instruction.ACTION)[0].error == StatusError.INSTRUCTION
    host.send(101, Instruction.REG_WRITE, write_parameters(65, b"\x01"))
    assert (host.read(101, "registered_instruction"), host.read(101, "led")) == (1, 0)
    assert host.send(BROADCAST, Instruction.ACTION) == []
    assert (host.read(101, "registered_instruction"), host.read(101, "led")) == (0, 1)


def test_what_cannot_be_done_is_said(host: WireHost) -> None:
    assert host.send(101, 0x33)[0].error == StatusError.INSTRUCTION
    assert host.send(101, Instruction.FACTORY_RESET, b"\xff")[0].error == StatusError.RESULT_FAIL
    assert host.send(101, Instruction.READ, b"\x84")[0].error == StatusError.DATA_LENGTH
    assert host.send(101, Instruction.READ, read_parameters(660, 9))[0].error == StatusError.ACCESS
    assert host.send(50, Instruction.PING) == []


def test_bulk_and_indirect_reads(host: WireHost) -> None:
    parameters = b"\x65\x90\x00\x02\x00\x66\x92\x00\x01\x00"
    volt, celsius = host.send(BROADCAST, Instruction.BULK_READ, parameters)
    assert (volt.id, volt.data) == (101, (120).to_bytes(2, "little"))
    assert (celsius.id, len(celsius.data)) == (102, 1)
    for byte in range(4):
        host.write(103, f"indirect_address_{byte + 1}", 116 + byte)
    host.write(103, "torque_enable", 1)
    goal = (1500).to_bytes(4, "little")
    assert host.send(103, Instruction.WRITE, write_parameters(224, goal))[0].error == 0
    assert host.read(103, "goal_position") == 1500
    (seen,) = host.send(103, Instruction.READ, read_parameters(224, 4))
    assert seen.data == goal


def test_every_crc_of_a_fast_sync_read_is_the_vendors(host: WireHost) -> None:
    """The vendor's function over everything up to each CRC, those before it included."""
    begin, end = PRESENT
    packet = instruction_packet(
        BROADCAST, Instruction.FAST_SYNC_READ, sync_read_parameters(begin, end - begin, IDS)
    )
    (sent,) = host.raw(packet)
    handler = Protocol2PacketHandler()
    for number in range(1, 5):
        place = 8 + number * 25 - 2
        crc = handler.updateCRC(0, sent.data, place)
        assert int.from_bytes(sent.data[place : place + 2], "little") == crc
    assert len(sent.data) == 7 + int.from_bytes(sent.data[5:7], "little") == 108
    blocks = fast_status_blocks(sent.data, end - begin)
    for block in blocks:
        alone = host.send(block.id, Instruction.READ, read_parameters(begin, end - begin))
        assert alone[0].data == block.data


@pytest.mark.parametrize("silent", [0, 1, 3])
def test_behind_a_silent_servo_nobody_is_heard_in_a_chain(host: WireHost, silent: int) -> None:
    host.simulation.servos[silent].silent = True
    assert [block.id for block in host.fast()] == list(IDS[:silent])
    parameters = sync_read_parameters(132, 4, IDS)
    answers = host.send(BROADCAST, Instruction.SYNC_READ, parameters)
    assert [answer.id for answer in answers] == list(IDS[:silent])


@pytest.mark.parametrize("baud_rate", [57_600, 1_000_000, 4_000_000])
def test_an_answer_takes_its_time_on_the_wire(baud_rate: int) -> None:
    host = WireHost()
    host.write(101, "return_delay_time", 100)
    for servo in host.simulation.servos:
        servo.registers["baud_rate"] = (9_600, 57_600, 0, 1_000_000, 0, 0, 4_000_000).index(
            baud_rate
        )
    host.baud_rate = baud_rate
    begin_ns = host.now_ns
    (sent,) = host.raw(instruction_packet(101, Instruction.PING))
    # 10 bytes there, 0.2 ms of return delay, 14 bytes back, ten bits each.
    assert sent.due_ns - begin_ns == pytest.approx(24 * 10e9 / baud_rate + 200_000, abs=2)


def test_a_cycle_of_four_servos_takes_as_long_as_on_the_real_bus() -> None:
    host = WireHost()
    host.drive()
    begin_ns = host.now_ns
    instructions = instruction_packet(
        BROADCAST,
        Instruction.SYNC_WRITE,
        b"\x74\x00\x04\x00" + b"e\0\4\0\0f\0\4\0\0g\0\4\0\0h\0\4\0\0",
    ) + instruction_packet(
        BROADCAST, Instruction.FAST_SYNC_READ, sync_read_parameters(126, 21, IDS)
    )
    (sent,) = host.raw(instructions)
    assert 1e9 / (sent.due_ns - begin_ns) == pytest.approx(625.0, rel=0.02)


def test_at_another_speed_nothing_is_heard(host: WireHost) -> None:
    host.baud_rate = 57_600
    assert host.send(101, Instruction.PING) == []
    host.baud_rate = 1_000_000
    assert host.write(101, "baud_rate", 1) == 0
    assert host.send(101, Instruction.PING) == []
    host.baud_rate = 57_600
    assert host.read(101, "baud_rate") == 1


def test_a_reboot_clears_errors_and_takes_a_while(host: WireHost) -> None:
    servo = host.simulation.servos[0]
    host.write(101, "torque_enable", 1)
    host.write(101, "profile_velocity", 87)
    servo.fail(HardwareError.OVERLOAD)
    assert not servo.motor.torque
    assert host.write(101, "torque_enable", 1) == StatusError.RESULT_FAIL | ALERT
    assert host.write(101, "torque_enable", 0) == ALERT
    assert host.send(101, Instruction.REBOOT)[0].error == ALERT
    assert host.send(101, Instruction.PING) == []
    host.sleep(BOOT_NS / 1e6)
    assert host.write(101, "torque_enable", 1) == 0
    assert host.read(101, "profile_velocity") == 0


def test_a_shadow_is_moved_along_but_says_nothing(host: WireHost) -> None:
    host.write(102, "secondary_id", 101)
    assert [answer.id for answer in host.send(101, Instruction.WRITE, b"\x41\x00\x01")] == [101]
    assert host.read(102, "led") == 1


def test_noise_and_halves_of_packets_are_skipped(host: WireHost, rng: np.random.Generator) -> None:
    ping = instruction_packet(103, Instruction.PING)
    noise = bytes(rng.integers(0, 255, 40, dtype=np.uint8))
    assert host.raw(noise + ping[:6]) == []
    assert len(host.raw(ping[6:])) == 1


def test_goals_are_noted_with_the_times_they_came(host: WireHost) -> None:
    host.drive()
    begin_ns = host.now_ns
    host.aim(dict.fromkeys(IDS, 2000))
    (goal,) = host.wire.goals
    assert goal.ticks == dict.fromkeys(IDS, 2000)
    assert goal.received_ns == begin_ns
    # 34 bytes at 1 M baud.
    assert goal.executed_ns - begin_ns == 340_000
