"""Instructions to servos and their answers, one transaction at a time.

For everything but the cycle, which has :mod:`hardware.servos.cyclic`. Nothing here waits busily,
and nothing waits longer than its deadline.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from hardware.servos.control_table import RETURN_DELAY_UNIT_US, TABLE
from hardware.servos.errors import ServoRefused, ServoSilent
from hardware.servos.port import SerialPort
from hardware.servos.protocol import (
    ALERT,
    BROADCAST,
    LARGEST_ID,
    OVERHEAD,
    Block,
    Instruction,
    Packet,
    PacketReader,
    fast_status_blocks,
    fast_status_length,
    instruction_packet,
    read_parameters,
    sync_read_parameters,
    sync_write_parameters,
    write_parameters,
)

_PATIENCE_S = 0.03
"""Beyond wire time and latency: for a host or an adapter that is busy elsewhere."""
_SLOT_S = 0.003
"""How long the vendor's SDK allows each possible id in answer to a broadcast ping."""
_LONGEST_DELAY_S = 254 * RETURN_DELAY_UNIT_US * 1e-6


class Found(NamedTuple):
    """A servo that answered a ping."""

    id: int
    model: int
    firmware: int
    alert: bool


class Counters:
    """What went wrong on the wire since the port was opened, and was not used.

    Attributes:
        missed: answers that did not come in time.
        damaged: answers whose CRC or form was wrong.
        strays: answers that nobody waits for: of a wrong id, late, or twice.
    """

    def __init__(self) -> None:
        self.missed = self.damaged = self.strays = 0


class ServoBus:
    """Servos behind one serial port.

    Attributes:
        port: the open port.
        counters: what went wrong so far.
    """

    def __init__(self, port: SerialPort, patience_s: float = _PATIENCE_S) -> None:
        """Use ``port``, which stays the caller's to close."""
        self.port = port
        self.counters = Counters()
        self._patience_s = patience_s
        self._reader = PacketReader()
        self._buffer = bytearray(4096)
        self._view = memoryview(self._buffer)

    def ping(self, servo: int, tries: int = 2) -> Found:
        """Ask one servo who it is.

        Raises:
            ServoSilent: if it does not answer.
        """
        answer = self._ask(servo, Instruction.PING, b"", 3, tries)
        return _found(answer)

    def broadcast_ping(self, until: int = LARGEST_ID) -> list[Found]:
        """All servos on the bus; they answer one after the other.

        Args:
            until: largest id that is waited for.
        """
        self._send(BROADCAST, Instruction.PING, b"")
        wire = (OVERHEAD + 4) * self.port.byte_s
        wait = (until + 1) * (wire + _SLOT_S) + self._patience_s + self.port.latency_s
        deadline = time.monotonic_ns() + round(wait * 1e9)
        found: dict[int, Found] = {}
        while self.port.wait(deadline):
            for packet in self._take():
                if packet.instruction == Instruction.STATUS and len(packet.parameters) == 4:
                    found[packet.id] = _found(packet)
        return list(found.values())

    def read(self, servo: int, register: str, tries: int = 2) -> int:
        """The number in a register.

        Raises:
            ServoSilent: if the servo does not answer.
            ServoRefused: if it refuses.
        """
        entry = TABLE[register]
        return entry.decode(self.read_bytes(servo, entry.address, entry.size, tries).data)

    def read_bytes(self, servo: int, address: int, size: int, tries: int = 2) -> Packet:
        """``size`` bytes from ``address``, as the answer's ``data``. Errors as :meth:`read`."""
        parameters = read_parameters(address, size)
        return self._ask(servo, Instruction.READ, parameters, size, tries)

    def write(self, servo: int, register: str, value: int, tries: int = 2) -> None:
        """Put a number into a register and wait for the servo to confirm.

        Raises:
            ServoSilent: if it does not confirm.
            ServoRefused: if it refuses.
        """
        entry = TABLE[register]
        self.write_bytes(servo, entry.address, entry.encode(value), tries)

    def write_bytes(self, servo: int, address: int, data: bytes, tries: int = 2) -> None:
        """Put ``data`` at ``address``. Errors as :meth:`write`."""
        self._ask(servo, Instruction.WRITE, write_parameters(address, data), 0, tries)

    def write_unconfirmed(self, servo: int, register: str, value: int) -> None:
        """Write without an answer, as to a servo that keeps silent or to all (``BROADCAST``)."""
        entry = TABLE[register]
        parameters = write_parameters(entry.address, entry.encode(value))
        self._send(servo, Instruction.WRITE, parameters)
        time.sleep((OVERHEAD + 2 + len(parameters)) * self.port.byte_s + _LONGEST_DELAY_S)

    def sync_write(self, register: str, values: Iterable[tuple[int, int]]) -> None:
        """Write the same register of several servos, (id, number) pairs; nobody confirms."""
        entry = TABLE[register]
        data = [(servo, entry.encode(value)) for servo, value in values]
        parameters = sync_write_parameters(entry.address, entry.size, data)
        self._send(BROADCAST, Instruction.SYNC_WRITE, parameters)
        time.sleep((OVERHEAD + len(parameters)) * self.port.byte_s)

    def sync_read(self, address: int, size: int, ids: Sequence[int]) -> list[Block]:
        """The same bytes of several servos; of those that answered."""
        self._send(BROADCAST, Instruction.SYNC_READ, sync_read_parameters(address, size, ids))
        blocks: list[Block] = []
        deadline = self._deadline((OVERHEAD + 1 + size) * len(ids))
        while len(blocks) < len(ids) and self.port.wait(deadline):
            blocks += [
                Block(packet.error, packet.id, packet.data)
                for packet in self._take()
                if self._is_answer(packet, ids, size)
            ]
        self.counters.missed += len(ids) - len(blocks)
        return blocks

    def fast_sync_read(self, address: int, size: int, ids: Sequence[int]) -> list[Block]:
        """The same bytes of several servos in one answer; of those before the first silent one.

        Firmware before 45 does not know it and keeps silent; :meth:`sync_read` is the way then.
        """
        parameters = sync_read_parameters(address, size, ids)
        self._send(BROADCAST, Instruction.FAST_SYNC_READ, parameters)
        wanted = fast_status_length(len(ids), size)
        deadline = self._deadline(wanted)
        count = 0
        while count < wanted and self.port.wait(deadline):
            count += self.port.read_into(self._view[count:])
        blocks = fast_status_blocks(self._view[:count], size)
        self.counters.missed += len(ids) - len(blocks)
        return blocks

    def reboot(self, servo: int) -> None:
        """Start a servo anew: clears its faults and its torque. Errors as :meth:`write`."""
        self._ask(servo, Instruction.REBOOT, b"", 0, 1)

    def clear_turns(self, servo: int) -> None:
        """Make the present position lie within one turn. Errors as :meth:`write`."""
        self._ask(servo, Instruction.CLEAR, b"\x01\x44\x58\x4c\x22", 0, 1)

    def _ask(
        self, servo: int, instruction: Instruction, parameters: bytes, size: int, tries: int
    ) -> Packet:
        """Send to one servo and wait for its answer with ``size`` bytes of data."""
        begin = time.monotonic()
        for _ in range(tries):
            self._send(servo, instruction, parameters)
            deadline = self._deadline(OVERHEAD + 1 + size)
            while self.port.wait(deadline):
                for packet in self._take():
                    if packet.id == servo and packet.instruction == Instruction.STATUS:
                        return self._accepted(packet, instruction, parameters)
                    self.counters.strays += 1
            self.counters.missed += 1
        raise ServoSilent(self.port.path, servo, time.monotonic() - begin)

    def _accepted(self, packet: Packet, instruction: Instruction, parameters: bytes) -> Packet:
        error = packet.error & ~ALERT
        if error:
            what = instruction.name.lower()
            if instruction in {Instruction.READ, Instruction.WRITE}:
                address = int.from_bytes(parameters[:2], "little")
                what = f"{what} {_name(address)}"
            raise ServoRefused(self.port.path, packet.id, error, what)
        return packet

    def _is_answer(self, packet: Packet, ids: Sequence[int], size: int) -> bool:
        if (
            packet.instruction == Instruction.STATUS
            and packet.id in ids
            and len(packet.data) == size
        ):
            return True
        self.counters.strays += 1
        return False

    def _send(self, servo: int, instruction: Instruction, parameters: bytes) -> None:
        self._reader.reset()
        if self.port.discard():
            self.counters.strays += 1
        self.port.expect(1)
        self._sent = instruction_packet(servo, instruction, parameters)
        self.port.write(self._sent)

    def _deadline(self, answer: int) -> int:
        """Monotonic time in ns by which an answer of so many bytes must be there."""
        wire = (len(self._sent) + answer) * self.port.byte_s
        wait = wire + _LONGEST_DELAY_S + 2 * self.port.latency_s + self._patience_s
        return time.monotonic_ns() + round(wait * 1e9)

    def _take(self) -> list[Packet]:
        count = self.port.read_into(self._view)
        before = self._reader.crc_errors
        packets = self._reader.feed(bytes(self._view[:count]))
        self.counters.damaged += self._reader.crc_errors - before
        return packets


def _found(packet: Packet) -> Found:
    data = packet.data
    alert = bool(packet.error & ALERT)
    return Found(packet.id, int.from_bytes(data[:2], "little"), data[2], alert)


def _name(address: int) -> str:
    names = [entry.name for entry in TABLE.values() if entry.address == address]
    return names[0] if names else f"address {address}"
