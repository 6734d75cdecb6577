"""A host on the simulated wire, with a clock that only goes on when it is told to."""

from __future__ import annotations

from hardware.fake_servos.faults import Faults, parse
from hardware.fake_servos.simulation import Mounting, Simulation
from hardware.fake_servos.wire import Outgoing, Wire
from hardware.servos.control_table import TABLE
from hardware.servos.protocol import (
    BROADCAST,
    Block,
    Instruction,
    Packet,
    PacketReader,
    fast_status_blocks,
    instruction_packet,
    read_parameters,
    sync_read_parameters,
    sync_write_parameters,
    write_parameters,
)

IDS = (101, 102, 103, 104)
TAUT = Mounting(slack_m=(0.0,) * 4)
"""Tendons that pull as soon as their spool turns."""


class WireHost:
    """Sends instructions and takes the answers, in simulated time."""

    def __init__(self, mounting: Mounting | None = None, faults: str = "") -> None:
        self.now_ns = 1_000_000_000
        self.faults = Faults()
        self.simulation = Simulation(mounting or Mounting(), self.now_ns)
        for fault in parse(faults, IDS, self.now_ns):
            self.faults.add(fault)
        self.wire = Wire(self.simulation, self.faults)
        self.baud_rate = self.simulation.servos[0].baud_rate
        self.reader = PacketReader()

    def sleep(self, milliseconds: float) -> None:
        """Let time go by."""
        self.now_ns += round(milliseconds * 1e6)
        self.simulation.advance(self.now_ns)

    def raw(self, data: bytes) -> list[Outgoing]:
        """Send bytes; what comes back, after which it is that late."""
        outgoing = self.wire.receive(data, self.now_ns, self.baud_rate)
        last = max((sent.due_ns for sent in outgoing), default=self.now_ns)
        self.sleep(max(last - self.now_ns, 0) / 1e6 + 1.0)
        return outgoing

    def send(self, servo: int, instruction: int, parameters: bytes = b"") -> list[Packet]:
        """Send an instruction; the answers that are whole."""
        outgoing = self.raw(instruction_packet(servo, instruction, parameters))
        return self.reader.feed(b"".join(sent.data for sent in outgoing))

    def write(self, servo: int, register: str, value: int) -> int | None:
        """Write one register; the error byte, or None without an answer."""
        entry = TABLE[register]
        parameters = write_parameters(entry.address, entry.encode(value))
        answers = self.send(servo, Instruction.WRITE, parameters)
        return answers[0].error if answers else None

    def read(self, servo: int, register: str) -> int:
        """Read one register."""
        entry = TABLE[register]
        (answer,) = self.send(servo, Instruction.READ, read_parameters(entry.address, entry.size))
        return entry.decode(answer.data)

    def aim(self, ticks: dict[int, int]) -> None:
        """Sync-write goal positions."""
        entry = TABLE["goal_position"]
        data = [(servo, entry.encode(goal)) for servo, goal in ticks.items()]
        parameters = sync_write_parameters(entry.address, entry.size, data)
        self.send(BROADCAST, Instruction.SYNC_WRITE, parameters)

    def fast(self, address: int = 126, size: int = 21) -> list[Block]:
        """Fast sync read of all servos; the blocks that are right."""
        parameters = sync_read_parameters(address, size, IDS)
        packet = instruction_packet(BROADCAST, Instruction.FAST_SYNC_READ, parameters)
        return fast_status_blocks(b"".join(sent.data for sent in self.raw(packet)), size)

    def drive(self, velocity: int = 87, acceleration: int = 0) -> None:
        """Torque on, with a profile in register units; 87 is 120 degrees a second."""
        for servo in IDS:
            self.write(servo, "return_delay_time", 0)
            self.write(servo, "profile_velocity", velocity)
            self.write(servo, "profile_acceleration", acceleration)
            self.write(servo, "torque_enable", 1)
