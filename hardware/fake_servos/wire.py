"""The wire: bytes from the host in, bytes of the servos out, each at the time it would take.

A byte takes ten bits. Servos answer after their return delay, one after the other. In the answer
to a sync or bulk read a servo waits for the one before it, so that behind a silent one nobody is
heard. A servo that is set to another speed than the port hears nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from hardware.fake_servos.faults import Fault, Faults, Kind
from hardware.fake_servos.servo import Answer, Servo
from hardware.fake_servos.simulation import Simulation
from hardware.servos.control_table import TABLE
from hardware.servos.protocol import (
    BROADCAST,
    FAST_START,
    OVERHEAD,
    Block,
    Instruction,
    Packet,
    PacketReader,
    StatusError,
    fast_status_packet,
    status_packet,
)

_BITS_PER_BYTE = 10
_SAME_SPEED = 0.03
"""How far two baud rates may differ and still understand each other."""
_NOBODY = 77
_GOAL = TABLE["goal_position"]
_KEPT_GOALS = 50_000
_BLOCK = 4
_CHAINED = {
    Instruction.SYNC_READ,
    Instruction.FAST_SYNC_READ,
    Instruction.BULK_READ,
    Instruction.FAST_BULK_READ,
}


class Outgoing(NamedTuple):
    """Something that leaves for the host.

    Attributes:
        due_ns: when its last byte has arrived.
        data: bytes.
        unplug: whether the port hangs up right behind it.
    """

    due_ns: int
    data: bytes
    unplug: bool = False


class GoalWrite(NamedTuple):
    """Goals that reached servos.

    Attributes:
        received_ns: when the host had handed the bytes to the port; monotonic clock.
        executed_ns: when the last of them was through the wire, and the servos knew.
        ticks: goals by id.
    """

    received_ns: int
    executed_ns: int
    ticks: dict[int, int]


class Wire:
    """The bus of one simulation.

    Args:
        simulation: what the servos do.
        faults: what goes wrong.
        adapter_ns: how long the adapter keeps what it has received before it hands it on.

    Attributes:
        goals: writes of goal positions, newest last.
        instructions: how many packets have come.
    """

    def __init__(self, simulation: Simulation, faults: Faults, adapter_ns: int = 0) -> None:
        self.simulation = simulation
        self.faults = faults
        self.goals: deque[GoalWrite] = deque(maxlen=_KEPT_GOALS)
        self.instructions = 0
        self._adapter_ns = adapter_ns
        self._reader = PacketReader()
        self._free_ns = 0
        self._received_ns = 0
        self._by_id: dict[int, Servo] = {}
        self._byte_ns = 0.0

    def hang_up(self) -> None:
        """Forget the beginning of a packet: its end will not come."""
        self._reader.reset()
        self._free_ns = 0

    def receive(self, data: bytes, now_ns: int, baud_rate: int) -> list[Outgoing]:
        """Take bytes from the host.

        Args:
            data: as they came.
            now_ns: monotonic clock.
            baud_rate: what the host has set its port to.

        Returns:
            What leaves for the host, in order.
        """
        self._received_ns = now_ns
        self._byte_ns = _BITS_PER_BYTE * 1e9 / baud_rate
        outgoing: list[Outgoing] = []
        time_ns = max(now_ns, self._free_ns)
        for packet in self._reader.feed(data):
            self.instructions += 1
            time_ns += self._wire_ns(OVERHEAD + len(packet.parameters))
            if self.faults.pick(Kind.INSTRUCTION, self._meant(packet), now_ns):
                return [*outgoing, Outgoing(now_ns, b"", True)]
            sent, time_ns = self._execute(packet, time_ns, baud_rate)
            outgoing += sent
        self._free_ns = time_ns
        return outgoing

    def _wire_ns(self, count: int) -> int:
        return round(count * self._byte_ns)

    def _meant(self, packet: Packet) -> list[int]:
        if packet.id != BROADCAST:
            return [packet.id]
        return [servo.number for servo in self.simulation.servos]

    def _execute(self, packet: Packet, now_ns: int, baud_rate: int) -> tuple[list[Outgoing], int]:
        """Let the servos act on a packet whose last byte arrives at ``now_ns``."""
        self.simulation.advance(now_ns)
        self._by_id = {}
        for servo in self.simulation.servos:
            if servo.listens(now_ns) and abs(servo.baud_rate / baud_rate - 1) < _SAME_SPEED:
                servo.hear(now_ns)
                self._by_id[servo.number] = servo
        if packet.instruction in _CHAINED:
            asked = _asked(packet)
            answers = self._chain(asked, now_ns)
            if packet.instruction in {Instruction.FAST_SYNC_READ, Instruction.FAST_BULK_READ}:
                return self._send_fast(asked, answers, now_ns)
        elif packet.instruction in {Instruction.SYNC_WRITE, Instruction.BULK_WRITE}:
            self._write_many(packet, now_ns)
            return [], now_ns
        else:
            answers = self._single(packet, now_ns)
        return self._send(answers, now_ns)

    # What servos do

    def _single(self, packet: Packet, now_ns: int) -> list[tuple[Servo, Answer]]:
        """Instructions to one servo, or to each of all."""
        if packet.id == BROADCAST:
            servos = [self._by_id[number] for number in sorted(self._by_id)]
        else:
            servos = [self._by_id[packet.id]] if packet.id in self._by_id else []
            self._shadow(packet, now_ns)
        answers = []
        for servo in servos:
            level = servo.registers["status_return_level"]
            answer = self._act(servo, packet, now_ns)
            everybody = packet.id == BROADCAST
            if packet.instruction == Instruction.PING:
                wanted = True
            elif packet.instruction == Instruction.READ:
                wanted = level >= 1 and not everybody
            else:
                wanted = level >= 2 and not everybody
            if wanted:
                answers.append((servo, answer))
        return answers

    def _shadow(self, packet: Packet, now_ns: int) -> None:
        """Servos that listen to a second id act on it as well, but do not answer."""
        for number, servo in self._by_id.items():
            if servo.registers["secondary_id"] == packet.id and number != packet.id:
                self._act(servo, packet, now_ns)

    def _act(self, servo: Servo, packet: Packet, now_ns: int) -> Answer:
        parameters = packet.parameters
        self.simulation.disturb()
        acts: dict[int, Callable[[], Answer]] = {
            Instruction.PING: servo.ping,
            Instruction.READ: lambda: self._read(servo, parameters, now_ns),
            Instruction.WRITE: lambda: self._write(servo, parameters, now_ns),
            Instruction.REG_WRITE: lambda: _register_write(servo, parameters),
            Instruction.ACTION: lambda: self._action(servo, now_ns),
            Instruction.REBOOT: lambda: servo.reboot(now_ns),
            Instruction.CLEAR: lambda: servo.clear(parameters),
            Instruction.FACTORY_RESET: lambda: servo.refuse(StatusError.RESULT_FAIL),
        }
        act = acts.get(packet.instruction, lambda: servo.refuse(StatusError.INSTRUCTION))
        return act()

    def _read(self, servo: Servo, parameters: bytes, now_ns: int) -> Answer:
        if len(parameters) != 4:
            return servo.refuse(StatusError.DATA_LENGTH)
        return servo.read(now_ns, _word(parameters, 0), _word(parameters, 2))

    def _write(self, servo: Servo, parameters: bytes, now_ns: int) -> Answer:
        if len(parameters) < 3:
            return servo.refuse(StatusError.DATA_LENGTH)
        address, data = _word(parameters, 0), parameters[2:]
        answer = servo.write(now_ns, address, data)
        self._note_goals([servo], address, len(data), now_ns)
        return answer

    def _action(self, servo: Servo, now_ns: int) -> Answer:
        before = servo.registers["goal_position"]
        answer = servo.action(now_ns)
        if servo.registers["goal_position"] != before:
            self._note_goals([servo], _GOAL.address, _GOAL.size, now_ns)
        return answer

    def _chain(self, asked: list[tuple[int, int, int]], now_ns: int) -> list[tuple[Servo, Answer]]:
        """Servos that answer in turn: up to the first one that is not heard."""
        answers = []
        for number, address, size in asked:
            servo = self._by_id.get(number)
            if servo is None or servo.registers.memory[68] == 0:
                break
            answers.append((servo, servo.read(now_ns, address, size)))
        return answers

    def _write_many(self, packet: Packet, now_ns: int) -> None:
        parameters = packet.parameters
        self.simulation.disturb()
        written: dict[tuple[int, int], list[Servo]] = {}
        begin = 4 if packet.instruction == Instruction.SYNC_WRITE else 0
        while begin < len(parameters):
            if packet.instruction == Instruction.SYNC_WRITE:
                address, size, head = _word(parameters, 0), _word(parameters, 2), 1
            elif begin + 5 <= len(parameters):
                address, size, head = _word(parameters, begin + 1), _word(parameters, begin + 3), 5
            else:
                return
            data = parameters[begin + head : begin + head + size]
            servo = self._by_id.get(parameters[begin])
            if servo is not None and len(data) == size:
                servo.write(now_ns, address, data)
                written.setdefault((address, size), []).append(servo)
            begin += head + size
        for (address, size), servos in written.items():
            self._note_goals(servos, address, size, now_ns)

    def _note_goals(self, servos: list[Servo], address: int, size: int, now_ns: int) -> None:
        if address <= _GOAL.address and _GOAL.end <= address + size:
            ticks = {servo.number: servo.registers["goal_position"] for servo in servos}
            self.goals.append(GoalWrite(self._received_ns, now_ns, ticks))

    # What goes back

    def _send(self, answers: list[tuple[Servo, Answer]], now_ns: int) -> tuple[list[Outgoing], int]:
        """Status packets one after the other."""
        if not answers:
            return [], now_ns
        numbers = [servo.number for servo, _ in answers]
        fault = self.faults.pick(Kind.REPLY, numbers, now_ns)
        victim = _victim(fault, numbers)
        outgoing: list[Outgoing] = []
        for servo, (error, data) in answers:
            struck = fault if fault is not None and servo.number == victim else None
            if fault is not None and fault.name == "timeouts" and victim in {servo.number, None}:
                # Whoever waits for the one that is not heard is not heard either.
                break
            number = _NOBODY if struck and struck.name == "wrong-id" else servo.number
            packet = status_packet(number, error, data)
            now_ns += servo.return_delay_ns + self._wire_ns(len(packet))
            outgoing += self._spoilt(struck, packet, now_ns, 0, len(packet))
            if struck and struck.name == "unplug-reading":
                break
        return outgoing, now_ns

    def _send_fast(
        self,
        asked: list[tuple[int, int, int]],
        answers: list[tuple[Servo, Answer]],
        now_ns: int,
    ) -> tuple[list[Outgoing], int]:
        """One packet that all servos write together."""
        numbers = [servo.number for servo, _ in answers]
        fault = self.faults.pick(Kind.REPLY, numbers, now_ns) if answers else None
        victim = _victim(fault, numbers)
        blocks: list[Block] = []
        for (servo, (error, data)), (_, _, size) in zip(answers, asked, strict=False):
            if fault is not None and fault.name == "timeouts" and victim in {servo.number, None}:
                break
            struck = fault is not None and fault.name == "wrong-id" and servo.number == victim
            blocks.append(
                Block(error, _NOBODY if struck else servo.number, data.ljust(size, b"\0"))
            )
            now_ns += servo.return_delay_ns
        if not blocks:
            return [], now_ns
        packet = fast_status_packet(blocks, len(asked))
        end = FAST_START
        for block, number in zip(blocks, numbers, strict=False):
            begin, end = end, end + len(block.data) + _BLOCK
            if number == victim:
                break
        now_ns += self._wire_ns(len(packet))
        return self._spoilt(fault, packet, now_ns, begin, end), now_ns

    def _spoilt(
        self, fault: Fault | None, packet: bytes, due_ns: int, begin: int, end: int
    ) -> list[Outgoing]:
        """A packet as it arrives; the fault strikes what stands from ``begin`` to ``end``."""
        due_ns += self._adapter_ns
        if fault is None or fault.name == "wrong-id":
            return [Outgoing(due_ns, packet)]
        middle = (begin + end) // 2
        if fault.name == "crc-flip":
            spoilt = bytearray(packet)
            spoilt[end - 3] ^= 0x10
            return [Outgoing(due_ns, bytes(spoilt))]
        if fault.name == "duplicate":
            again_ns = due_ns + self._wire_ns(len(packet))
            return [Outgoing(due_ns, packet), Outgoing(again_ns, packet)]
        if fault.name == "late":
            return [Outgoing(due_ns + round(fault.delay_ms * 1e6), packet)]
        cut_ns = due_ns - self._wire_ns(len(packet) - middle)
        return [Outgoing(cut_ns, packet[:middle], fault.name == "unplug-reading")]


def _register_write(servo: Servo, parameters: bytes) -> Answer:
    if len(parameters) < 3:
        return servo.refuse(StatusError.DATA_LENGTH)
    return servo.register_write(_word(parameters, 0), parameters[2:])


def _word(data: bytes, place: int) -> int:
    return data[place] | data[place + 1] << 8


def _victim(fault: Fault | None, numbers: list[int]) -> int | None:
    """Id of the servo whose answer is struck; None with a burst of time-outs of all."""
    if fault is None or (fault.name == "timeouts" and fault.servo is None):
        return None
    return numbers[-1] if fault.servo is None else fault.servo


def _asked(packet: Packet) -> list[tuple[int, int, int]]:
    """Id, address and size of what each servo shall read, in order."""
    parameters = packet.parameters
    if packet.instruction in {Instruction.SYNC_READ, Instruction.FAST_SYNC_READ}:
        if len(parameters) < 5:
            return []
        address, size = _word(parameters, 0), _word(parameters, 2)
        return [(number, address, size) for number in parameters[4:]]
    return [
        (parameters[begin], _word(parameters, begin + 1), _word(parameters, begin + 3))
        for begin in range(0, len(parameters) - 4, 5)
    ]
