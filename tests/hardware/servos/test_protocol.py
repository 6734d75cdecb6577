"""Packets: round trips, the vendor's SDK as the oracle, damage and noise."""

from __future__ import annotations

import numpy as np
import pytest
from dynamixel_sdk import Protocol2PacketHandler

from hardware.servos.protocol import (
    BROADCAST,
    HEADER,
    Block,
    Instruction,
    Packet,
    PacketReader,
    crc16,
    fast_status_blocks,
    fast_status_length,
    fast_status_packet,
    instruction_packet,
    status_packet,
    stuff,
    sync_read_parameters,
    sync_write_parameters,
    unstuff,
)

SDK = Protocol2PacketHandler()
RANDOM = np.random.default_rng(430)


def _payload(length: int) -> bytes:
    """Random bytes, rich in what has to be stuffed."""
    values = np.array([0xFF, 0xFF, 0xFF, 0xFD, 0xFD, 0x00, 0x55], np.uint8)
    return RANDOM.choice(values, length).tobytes()


def _sdk_packet(servo: int, body: bytes) -> bytes:
    """The same packet by the vendor's SDK, which leaves header and CRC to its sender."""
    length = len(body) + 2
    plain = [*HEADER, servo, length & 0xFF, length >> 8, *body, 0, 0]
    stuffed = SDK.addStuffing(plain)
    total = (stuffed[5] | stuffed[6] << 8) + 7
    crc = SDK.updateCRC(0, stuffed, total - 2)
    return bytes([*stuffed[: total - 2], crc & 0xFF, crc >> 8])


@pytest.mark.parametrize("length", [0, 1, 2, 3, 4, 7, 21, 60, 200])
def test_packets_are_those_of_the_sdk_and_come_back(length: int) -> None:
    for _ in range(40):
        payload = _payload(length)
        packet = instruction_packet(101, Instruction.WRITE, payload)
        assert packet == _sdk_packet(101, bytes((Instruction.WRITE,)) + payload)
        assert PacketReader().feed(packet) == [Packet(101, Instruction.WRITE, payload)]


def test_the_crc_is_the_sdks() -> None:
    for _ in range(200):
        data = RANDOM.integers(0, 256, int(RANDOM.integers(1, 80)), np.uint8).tobytes()
        cut = int(RANDOM.integers(0, len(data)))
        assert crc16(data) == SDK.updateCRC(0, data, len(data))
        assert crc16(data[cut:], crc16(data[:cut])) == crc16(data)


def test_a_manuals_packet() -> None:
    # e-manual, Protocol 2.0: ping of id 1, and the answer of model 1030, firmware 38.
    assert instruction_packet(1, Instruction.PING).hex(" ") == "ff ff fd 00 01 03 00 01 19 4e"
    answer = status_packet(1, 0, b"\x06\x04\x26")
    assert answer.hex(" ") == "ff ff fd 00 01 07 00 55 00 06 04 26 65 5d"


def test_stuffing_hides_every_header_and_can_be_undone() -> None:
    for _ in range(500):
        body = _payload(40)
        stuffed = stuff(body)
        assert HEADER not in stuffed
        assert unstuff(stuffed) == body


def test_a_packet_may_come_in_pieces() -> None:
    packets = [status_packet(servo, 0, _payload(9)) for servo in (101, 102, 103)]
    stream = b"".join(packets)
    for _ in range(50):
        reader, found, begin = PacketReader(), [], 0
        while begin < len(stream):
            end = begin + int(RANDOM.integers(1, 9))
            found += reader.feed(stream[begin:end])
            begin = end
        assert [packet.id for packet in found] == [101, 102, 103]
        assert (reader.dropped, reader.pending) == (0, 0)


def test_the_reader_finds_the_next_packet_behind_any_noise() -> None:
    for _ in range(300):
        noise = _payload(int(RANDOM.integers(1, 30)))
        reader = PacketReader()
        packet = status_packet(102, 0, b"abc")
        # A header in the noise may announce a length, which ends with the transaction.
        found = reader.feed(noise + packet)
        if not found:
            reader.reset()
            found = reader.feed(packet)
        assert found == [Packet(102, Instruction.STATUS, b"\x00abc")]
        assert reader.dropped >= len(noise)


@pytest.mark.parametrize("payload", [b"\x00\x08\x00\x00", b"\xff\xff\xfd\xff\xff\xfd"])
def test_a_packet_with_one_flipped_bit_is_refused(payload: bytes) -> None:
    packet = status_packet(103, 0, payload)
    for bit in range(8 * len(packet)):
        damaged = bytearray(packet)
        damaged[bit // 8] ^= 1 << bit % 8
        reader = PacketReader()
        assert reader.feed(bytes(damaged)) == []
        reader.reset()
        assert reader.dropped == len(packet)


def test_a_packet_behind_a_damaged_length_is_not_lost() -> None:
    damaged = bytearray(status_packet(101, 0, b"1234"))
    damaged[5] += 10
    reader = PacketReader()
    found = reader.feed(bytes(damaged) + status_packet(102, 0, b"5678") + bytes(20))
    assert found == [Packet(102, Instruction.STATUS, b"\x005678")]
    assert reader.crc_errors == 1


def _blocks(size: int = 21) -> list[Block]:
    return [Block(0, servo, _payload(size)) for servo in (101, 102, 103, 104)]


def test_a_fast_status_holds_a_block_of_each_servo() -> None:
    for _ in range(50):
        blocks = _blocks()
        packet = fast_status_packet(blocks, 4)
        assert len(packet) == fast_status_length(4, 21)
        assert fast_status_blocks(packet, 21) == blocks
        # The SDK checks the last CRC over the whole packet, and so does the reader.
        assert SDK.updateCRC(0, packet, len(packet) - 2) == packet[-2] | packet[-1] << 8
        [found] = PacketReader().feed(packet)
        assert (found.id, found.instruction) == (BROADCAST, Instruction.STATUS)


def test_of_a_damaged_fast_status_only_what_came_before_the_damage_is_used() -> None:
    blocks = _blocks()
    packet = fast_status_packet(blocks, 4)
    for bit in range(8 * len(packet)):
        damaged = bytearray(packet)
        damaged[bit // 8] ^= 1 << bit % 8
        whole = max(0, (bit // 8 - 8) // 25)
        assert fast_status_blocks(damaged, 21) == blocks[:whole]


def test_a_fast_status_may_end_early() -> None:
    blocks = _blocks()
    packet = fast_status_packet(blocks[:2], 4)
    for length in range(len(packet) + 1):
        assert fast_status_blocks(packet[:length], 21) == blocks[: max(0, (length - 8) // 25)]


def test_parameters_of_the_sync_instructions() -> None:
    assert sync_read_parameters(132, 4, (1, 2)).hex(" ") == "84 00 04 00 01 02"
    written = sync_write_parameters(116, 4, [(1, bytes(4)), (2, b"\x00\x08\x00\x00")])
    assert written.hex(" ") == "74 00 04 00 01 00 00 00 00 02 00 08 00 00"
