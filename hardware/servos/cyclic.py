"""One cycle of the bus: four goals out, what four servos measure in. Everything is laid out before.

A sync write and a fast sync read leave together in one write; the answer's length is known, so the
thread sleeps until its last byte. What is damaged, of a wrong id, too many or too early is never
used: the values of the servos concerned stay as they were.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Sequence

from hardware.servos.bus import ServoBus
from hardware.servos.control_table import PRESENT, TABLE
from hardware.servos.protocol import (
    BROADCAST,
    CRC_TABLE,
    HEADER,
    OVERHEAD,
    Instruction,
    Packet,
    PacketReader,
    crc16,
    fast_status_length,
    instruction_packet,
    sync_read_parameters,
    sync_write_parameters,
)

ALL = 0b1111
"""What :meth:`CyclicExchange.exchange` returns when all servos answered."""

_SIZE = PRESENT[1] - PRESENT[0]
_VALUES = struct.Struct("<hiiiiHB")
_BLOCK = struct.Struct("<BBhiiiiHBH")
_GOAL = struct.Struct("<i")
_FIRST_GOAL, _GOAL_STEP = 13, 5
_SMALLEST, _LARGEST = 0, 4095
_EARLY = 0.5
"""An answer in less than this share of its time on the wire is one to an earlier question."""


class CyclicExchange:
    """Writes goals to four servos and reads them back.

    The lists hold one number per servo, as the servo tells it (units of the control table), and
    keep their values where an answer is missing.

    Attributes:
        error: error bytes of the last answers; the alert bit means a hardware error.
        load: present loads.
        velocity: present velocities.
        position: present positions, ticks.
        voltage: input voltages.
        temperature: temperatures.
        wire_s: how long one exchange takes on the wire.
    """

    def __init__(
        self, bus: ServoBus, ids: Sequence[int], fast: bool = True, patience_s: float = 0.004
    ) -> None:
        """Lay out the packets.

        Args:
            bus: gives port and counters.
            ids: four ids, in the order of the tendons.
            fast: whether the servos know the fast sync read.
            patience_s: how long an answer may take beyond wire time and adapter.
        """
        self._port, self._counters = bus.port, bus.counters
        self._ids, self._fast = tuple(ids), fast
        goal = TABLE["goal_position"]
        zeros = [(servo, bytes(goal.size)) for servo in ids]
        parameters = sync_write_parameters(goal.address, goal.size, zeros)
        write = instruction_packet(BROADCAST, Instruction.SYNC_WRITE, parameters)
        reading = Instruction.FAST_SYNC_READ if fast else Instruction.SYNC_READ
        parameters = sync_read_parameters(PRESENT[0], _SIZE, ids)
        read = instruction_packet(BROADCAST, reading, parameters)
        self._out = bytearray(write + read)
        self._read_only = bytes(read)
        self._goals_end = len(write) - 2
        self._goals = memoryview(self._out)[_FIRST_GOAL - 1 : self._goals_end]
        self._prefix_crc = crc16(write[: _FIRST_GOAL - 1])
        count = len(self._ids)
        self._wanted = fast_status_length(count, _SIZE) if fast else count * (OVERHEAD + 1 + _SIZE)
        self.wire_s = (len(self._out) + self._wanted) * self._port.byte_s
        self._timeout_ns = round((self.wire_s + 2 * self._port.latency_s + patience_s) * 1e9)
        self._earliest_ns = round(_EARLY * self._wanted * self._port.byte_s * 1e9)
        self._buffer = bytearray(1024)
        self._view = memoryview(self._buffer)
        start = HEADER + bytes((BROADCAST,)) + (self._wanted - 7).to_bytes(2, "little")
        self._start = start + bytes((Instruction.STATUS,))
        self._start_crc = crc16(self._start)
        self._reader = PacketReader()
        self._all = (1 << count) - 1
        self.error, self.load, self.velocity = [0] * count, [0] * count, [0] * count
        self.position, self.voltage = [0] * count, [0] * count
        self.temperature = [0] * count

    def exchange(self, goals: Sequence[int] | None) -> int:
        """Write ``goals`` (ticks, clamped to one turn; None writes none) and read all servos.

        Returns:
            A bit for each servo that answered; its values are new.

        Raises:
            PortLost: if the port is gone.
        """
        port = self._port
        if port.discard():
            self._counters.strays += 1
        port.expect(self._wanted if self._fast else 1)
        # Taken before: whoever is put aside behind the write would find its answer too early.
        begin = time.monotonic_ns()
        if goals is None:
            port.write(self._read_only)
        else:
            self._put(goals)
            port.write(self._out)
        if self._fast:
            return self._fast_answer(begin)
        return self._plain_answer(begin + self._timeout_ns)

    def _put(self, goals: Sequence[int]) -> None:
        out, place = self._out, _FIRST_GOAL
        for goal in goals:
            _GOAL.pack_into(out, place, min(max(goal, _SMALLEST), _LARGEST))
            place += _GOAL_STEP
        crc, table = self._prefix_crc, CRC_TABLE
        for byte in self._goals:
            crc = ((crc << 8) & 0xFF00) ^ table[(crc >> 8) ^ byte]
        out[self._goals_end] = crc & 0xFF
        out[self._goals_end + 1] = crc >> 8

    def _fast_answer(self, begin_ns: int) -> int:
        port, counters = self._port, self._counters
        port.wait(begin_ns + self._timeout_ns)
        count = 0
        # A terminal hands out 64 bytes at a time.
        while got := port.read_into(self._view[count:]):
            count += got
        early = time.monotonic_ns() - begin_ns < self._earliest_ns
        if count > self._wanted or (early and count):
            # Two answers, or one to an earlier question: nobody can tell which is the right one.
            counters.strays += 1
            return 0
        answered = self._take_blocks(count)
        if answered != self._all:
            if count == self._wanted:
                counters.damaged += 1
            else:
                counters.missed += 1
        return answered

    def _take_blocks(self, count: int) -> int:
        buffer, view, table = self._buffer, self._view, CRC_TABLE
        if not buffer.startswith(self._start, 0, count):
            return 0
        crc, place, answered = self._start_crc, len(self._start), 0
        for index, servo in enumerate(self._ids):
            end = place + _BLOCK.size
            if end > count:
                break
            for byte in view[place : end - 2]:
                crc = ((crc << 8) & 0xFF00) ^ table[(crc >> 8) ^ byte]
            block = _BLOCK.unpack_from(buffer, place)
            if block[9] != crc:
                break
            if block[1] == servo:
                self._store(index, block[0], block[2:9])
                answered |= 1 << index
            else:
                self._counters.strays += 1
            # The next servo's CRC counts this one's too.
            for byte in view[end - 2 : end]:
                crc = ((crc << 8) & 0xFF00) ^ table[(crc >> 8) ^ byte]
            place = end
        return answered

    def _plain_answer(self, deadline_ns: int) -> int:
        port, reader, counters = self._port, self._reader, self._counters
        reader.reset()
        damaged, answered = reader.crc_errors, 0
        while answered != self._all and port.wait(deadline_ns):
            count = port.read_into(self._view)
            for packet in reader.feed(bytes(self._view[:count])):
                if not self._is_status(packet):
                    counters.strays += 1
                    continue
                index = self._ids.index(packet.id)
                self._store(index, packet.error, _VALUES.unpack(packet.data))
                answered |= 1 << index
        counters.damaged += reader.crc_errors - damaged
        if answered != self._all and reader.crc_errors == damaged:
            counters.missed += 1
        return answered

    def _is_status(self, packet: Packet) -> bool:
        is_status = packet.instruction == Instruction.STATUS and packet.id in self._ids
        return is_status and len(packet.data) == _SIZE

    def _store(self, index: int, error: int, values: tuple[int, ...]) -> None:
        self.error[index] = error
        self.load[index], self.velocity[index], self.position[index] = values[:3]
        self.voltage[index], self.temperature[index] = values[5], values[6]
