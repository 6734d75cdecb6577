"""Dynamixel Protocol 2.0: how an instruction or a status becomes bytes, and back.

A packet is ``FF FF FD 00 | id | length (2) | instruction | parameters | CRC (2)``, low bytes
first; ``length`` counts from the instruction to the CRC. A status packet is the instruction
0x55 whose first parameter is the error byte. Wherever ``FF FF FD`` occurs from the instruction on,
an ``FD`` is stuffed behind it, so that a header begins a packet and nothing else.

The answer to a fast sync read is one packet of the broadcast id, written by all servos in turn:
after the instruction a block ``error | id | data | CRC`` each, whose CRC counts from the header on.
It is read by position and therefore not stuffed.

Source: ROBOTIS e-manual, DYNAMIXEL Protocol 2.0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum
from typing import NamedTuple

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 0xFE
LARGEST_ID = 252
LARGEST_LENGTH = 1024
"""Longest packet that is believed: what the vendor's SDK takes."""

OVERHEAD = 10
"""Bytes of a packet without parameters: header, id, length, instruction, CRC."""
BLOCK_OVERHEAD = 4
"""Bytes of a fast status block without its data: error, id, CRC."""
FAST_START = 8
"""Where the first block of a fast status packet begins."""
ALERT = 0x80
"""Bit of the error byte: register 70 says what is wrong with the servo."""

_POLYNOMIAL = 0x8005
_STUFFED, _PATTERN = b"\xff\xff\xfd\xfd", b"\xff\xff\xfd"
_FIRST = 7
"""Where the instruction stands."""


class Instruction(IntEnum):
    """What a servo can be told."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    FACTORY_RESET = 0x06
    REBOOT = 0x08
    CLEAR = 0x10
    STATUS = 0x55
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    FAST_SYNC_READ = 0x8A
    BULK_READ = 0x92
    BULK_WRITE = 0x93
    FAST_BULK_READ = 0x9A


class StatusError(IntEnum):
    """Why a servo refuses an instruction: the error byte without its alert bit."""

    NONE = 0
    RESULT_FAIL = 1
    INSTRUCTION = 2
    CRC = 3
    DATA_RANGE = 4
    DATA_LENGTH = 5
    DATA_LIMIT = 6
    ACCESS = 7


class Packet(NamedTuple):
    """A packet as it is meant: without header, stuffing and CRC.

    Attributes:
        id: the servo's, or ``BROADCAST``.
        instruction: one of ``Instruction``, or what a stranger sent.
        parameters: of a status, the error byte first; of a fast status, all blocks but for the
            last CRC.
    """

    id: int
    instruction: int
    parameters: bytes

    @property
    def error(self) -> int:
        """Error byte of a status, alert bit included."""
        return self.parameters[0]

    @property
    def data(self) -> bytes:
        """What a status holds behind its error byte."""
        return self.parameters[1:]


class Block(NamedTuple):
    """One servo's part of the answer to a fast sync read."""

    error: int
    id: int
    data: bytes


def _table() -> tuple[int, ...]:
    entries = []
    for index in range(256):
        value = index << 8
        for _ in range(8):
            value = (value << 1) ^ (_POLYNOMIAL if value & 0x8000 else 0)
        entries.append(value & 0xFFFF)
    return tuple(entries)


CRC_TABLE = _table()


def crc16(data: bytes | bytearray | memoryview, crc: int = 0) -> int:
    """CRC-16 of ``data`` (polynomial 0x8005, not reflected), going on from ``crc``."""
    table = CRC_TABLE
    for byte in data:
        crc = ((crc << 8) & 0xFF00) ^ table[(crc >> 8) ^ byte]
    return crc


def stuff(body: bytes) -> bytes:
    """Instruction and parameters, with ``FD`` behind each ``FF FF FD``."""
    return body.replace(_PATTERN, _STUFFED) if _PATTERN in body else body


def unstuff(body: bytes) -> bytes:
    """Undo :func:`stuff`."""
    return body.replace(_STUFFED, _PATTERN) if _PATTERN in body else body


def instruction_packet(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """The bytes of an instruction to the servo with this id, or to all (``BROADCAST``)."""
    body = stuff(bytes((instruction,)) + parameters)
    packet = HEADER + bytes((servo,)) + (len(body) + 2).to_bytes(2, "little") + body
    return packet + crc16(packet).to_bytes(2, "little")


def status_packet(servo: int, error: int, data: bytes = b"") -> bytes:
    """The bytes of an answer."""
    return instruction_packet(servo, Instruction.STATUS, bytes((error,)) + data)


def read_parameters(address: int, size: int) -> bytes:
    """Parameters of READ, and the first ones of both sync reads."""
    return address.to_bytes(2, "little") + size.to_bytes(2, "little")


def write_parameters(address: int, data: bytes) -> bytes:
    """Parameters of WRITE and REG_WRITE."""
    return address.to_bytes(2, "little") + data


def sync_read_parameters(address: int, size: int, ids: Iterable[int]) -> bytes:
    """Parameters of SYNC_READ and FAST_SYNC_READ: the same registers of several servos."""
    return read_parameters(address, size) + bytes(ids)


def sync_write_parameters(address: int, size: int, data: Iterable[tuple[int, bytes]]) -> bytes:
    """Parameters of SYNC_WRITE: ``size`` bytes each for several servos, (id, bytes) pairs."""
    return read_parameters(address, size) + b"".join(
        bytes((servo,)) + values for servo, values in data
    )


def fast_status_length(count: int, size: int) -> int:
    """Bytes of the whole answer of ``count`` servos to a fast sync read of ``size`` bytes."""
    return FAST_START + count * (size + BLOCK_OVERHEAD)


def fast_status_packet(blocks: Sequence[Block], count: int) -> bytes:
    """What servos put on the wire in answer to a fast sync read.

    Args:
        blocks: those that answer, in order, all with equally much data.
        count: how many were asked; the first to answer announces the length for all.
    """
    size = len(blocks[0].data)
    length = fast_status_length(count, size) - _FIRST
    packet = HEADER + bytes((BROADCAST,)) + length.to_bytes(2, "little")
    packet += bytes((Instruction.STATUS,))
    crc, begin = 0, 0
    for block in blocks:
        packet += bytes((block.error, block.id)) + block.data
        crc = crc16(packet[begin:], crc)
        begin = len(packet)
        packet += crc.to_bytes(2, "little")
    return packet


def fast_status_blocks(packet: bytes | bytearray | memoryview, size: int) -> list[Block]:
    """Those blocks of a fast status packet whose CRC is right, up to the first that is not.

    Args:
        packet: its bytes from the header on; the end may be missing, as after a silent servo.
        size: bytes that were asked of each servo.
    """
    if bytes(packet[:5]) != HEADER + bytes((BROADCAST,)):
        return []
    blocks: list[Block] = []
    crc, checked = 0, 0
    step = size + BLOCK_OVERHEAD
    for begin in range(FAST_START, len(packet) - step + 1, step):
        end = begin + step - 2
        crc = crc16(packet[checked:end], crc)
        checked = end
        if crc != packet[end] | packet[end + 1] << 8:
            break
        data = bytes(packet[begin + 2 : end])
        blocks.append(Block(packet[begin], packet[begin + 1], data))
    return blocks


class PacketReader:
    """Finds the packets in a stream of bytes that may be cut, damaged or mixed with noise.

    Attributes:
        dropped: bytes so far that belonged to no whole packet.
        crc_errors: packets so far whose CRC was wrong.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self.crc_errors = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Packet]:
        """Take in some bytes; the packets that are complete now, in order."""
        buffer = self._buffer
        buffer += data
        packets: list[Packet] = []
        while True:
            self._skip_to_header()
            if len(buffer) < _FIRST:
                return packets
            length = buffer[5] | buffer[6] << 8
            if buffer[4] in {0xFD, 0xFF} or not 3 <= length <= LARGEST_LENGTH - _FIRST:
                self._drop(1)
                continue
            end = _FIRST + length
            if len(buffer) < end:
                return packets
            packet = bytes(buffer[:end])
            if crc16(packet[:-2]) != packet[-2] | packet[-1] << 8:
                # Its length may be what was damaged, and the next packet stand inside of it.
                self.crc_errors += 1
                self._drop(1)
                continue
            del buffer[:end]
            packets.append(_meaning(packet))

    def reset(self) -> None:
        """Forget the beginning of a packet whose end will not come any more."""
        self._drop(len(self._buffer))

    @property
    def pending(self) -> int:
        """Bytes that wait for the rest of their packet."""
        return len(self._buffer)

    def _skip_to_header(self) -> None:
        begin = self._buffer.find(HEADER)
        if begin < 0:
            begin = len(self._buffer)
            # What could be the beginning of a header is kept.
            for kept in range(min(3, begin), 0, -1):
                if HEADER.startswith(self._buffer[-kept:]):
                    begin -= kept
                    break
        if begin:
            self._drop(begin)

    def _drop(self, count: int) -> None:
        self.dropped += count
        del self._buffer[:count]


def _meaning(packet: bytes) -> Packet:
    servo, body = packet[4], packet[_FIRST:-2]
    if not (servo == BROADCAST and body[0] == Instruction.STATUS):
        body = unstuff(body)
    return Packet(servo, body[0], body[1:])
