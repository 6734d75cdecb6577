"""The simulator as a program: port, wire, faults and control channel in one loop that sleeps."""

from __future__ import annotations

import gc
import heapq
import os
import select
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hardware.control_channel import BadRequest, ControlChannel
from hardware.fake_servos.faults import Fault, Faults, Kind, make, parse
from hardware.fake_servos.pseudo_terminal import PseudoTerminal
from hardware.fake_servos.servo import Servo
from hardware.fake_servos.simulation import Mounting, Sample, Simulation
from hardware.fake_servos.wire import Wire
from hardware.servos.control_table import HardwareError

_IDLE_S, _BUSY_S = 0.25, 0.02
_BEHIND_NS = 10_000_000
"""How far the motion may be behind the clock while nobody asks for it."""
_ROWS = 5000
_HOT_CELSIUS, _LOW_VOLT = 80.0, 5.0
_PRIORITY = 40
"""Below a control loop: what is simulated here has no scheduler, but must not starve others."""


@dataclass(frozen=True)
class Options:
    """What the program is started with.

    Attributes:
        link: name of the port.
        mounting: the servos and what they pull on.
        faults: as on the command line; injected at once.
        adapter_ms: how long the adapter keeps what it has received.
        return_delay_us: register 9 of all servos at first.
        realtime: whether to ask for SCHED_FIFO, so that answers come in time on a busy machine.
    """

    link: Path
    mounting: Mounting = field(default_factory=Mounting)
    faults: str = ""
    adapter_ms: float = 0.0
    return_delay_us: int = 500
    realtime: bool = True

    @property
    def control(self) -> Path:
        """Path of the control channel."""
        return control_path(self.link)


def control_path(link: Path) -> Path:
    """Where the control channel of the servos at this port stands.

    Hidden, so that a host that looks for ports by a pattern does not take it for one.
    """
    return link.with_name(f".{link.name}.control")


class Program:
    """Everything that runs.

    Args:
        options: see :class:`Options`.
    """

    def __init__(self, options: Options) -> None:
        now_ns = time.monotonic_ns()
        self.faults = Faults()
        self.simulation = Simulation(options.mounting, now_ns)
        for servo in self.simulation.servos:
            servo.registers["return_delay_time"] = min(options.return_delay_us // 2, 254)
        self.wire = Wire(self.simulation, self.faults, round(options.adapter_ms * 1e6))
        self._ids = [servo.number for servo in self.simulation.servos]
        wanted = parse(options.faults, self._ids, now_ns)
        self.port = PseudoTerminal(options.link)
        self._link = options.link
        self._names = 0
        self._plug_ns = 0
        self._queue: list[tuple[int, int, bytes, bool]] = []
        self._count = 0
        self.control = ControlChannel(options.control, self._answer, time.monotonic_ns)
        for fault in wanted:
            self._inject(fault)

    def run(self, stopped: Callable[[], bool]) -> None:
        """Serve until ``stopped()``; that is asked at least four times a second."""
        try:
            while not stopped():
                self._turn()
        finally:
            self.port.unplug()
            self.control.close()

    def _turn(self) -> None:
        """Wait for the next thing to do, and do it."""
        waited = self.control.descriptors()
        if self.port.master >= 0:
            waited.append(self.port.master)
        ready = select.select(waited, [], [], self._sleep_s())[0]
        now_ns = time.monotonic_ns()
        for descriptor in ready:
            if descriptor == self.port.master:
                data = self.port.read()
                for sent in self.wire.receive(data, now_ns, self.port.baud_rate() or 1):
                    self._count += 1
                    entry = (sent.due_ns, self._count, sent.data, sent.unplug)
                    heapq.heappush(self._queue, entry)
            else:
                self.control.serve(descriptor)
        self._send_due()
        now_ns = time.monotonic_ns()
        if now_ns - self.simulation.now_ns > _BEHIND_NS:
            self.simulation.advance(now_ns)
        for fault in self.faults.expired(now_ns):
            self._clear(fault)
        if self._plug_ns and now_ns >= self._plug_ns:
            self._plug(self._another_name())

    def _sleep_s(self) -> float:
        now_ns = time.monotonic_ns()
        if self._queue:
            return max(self._queue[0][0] - now_ns, 0) * 1e-9
        if self._plug_ns:
            return min(max(self._plug_ns - now_ns, 0) * 1e-9, _BUSY_S)
        timed = any(fault.for_ms and not fault.over for fault in self.faults.all)
        return _BUSY_S if timed or not self.simulation.still else _IDLE_S

    def _send_due(self) -> None:
        while self._queue and self._queue[0][0] <= time.monotonic_ns():
            _, _, data, unplug = heapq.heappop(self._queue)
            if data:
                self.port.write(data)
            if unplug:
                self._unplug()

    # The port

    def _unplug(self) -> None:
        self.port.unplug()
        self.wire.hang_up()
        self._queue.clear()

    def _plug(self, link: Path) -> None:
        self._plug_ns = 0
        self._unplug()
        self.port.plug(link)

    def _another_name(self) -> Path:
        """As if the system had counted on: the name with a number behind it."""
        self._names += 1
        return self._link.with_name(f"{self._link.name}-{self._names}")

    # Faults

    def _inject(self, fault: Fault) -> None:
        now_ns = time.monotonic_ns()
        self.simulation.advance(now_ns)
        self.simulation.disturb()
        if fault.kind in {Kind.CONDITION, Kind.ACT}:
            if fault.kind is Kind.CONDITION and fault.servo is None:
                fault.servo = self._ids[0]
            self._strike(fault)
            fault.happens(now_ns)
        self.faults.add(fault)

    def _struck(self, fault: Fault) -> tuple[int, Servo]:
        index = self._ids.index(fault.servo or self._ids[0])
        return index, self.simulation.servos[index]

    def _strike(self, fault: Fault) -> None:
        """Begin a condition, or do an act."""
        if fault.kind is Kind.ACT:
            self._unplug()
            if fault.name == "another-name":
                self._plug_ns = time.monotonic_ns() + round(fault.delay_ms * 1e6)
            return
        index, servo = self._struck(fault)
        if fault.name == "overload":
            servo.fail(HardwareError.OVERLOAD)
        elif fault.name == "overheat":
            servo.forced_celsius = _HOT_CELSIUS if fault.value is None else fault.value
        elif fault.name == "voltage":
            servo.forced_volt = _LOW_VOLT if fault.value is None else fault.value
        elif fault.name == "silent":
            servo.silent = True
        elif fault.name == "encoder-stuck":
            servo.motor.stuck_at = servo.motor.position
        else:
            self.simulation.reverse(index)
        servo.protect()

    def _clear(self, fault: Fault) -> None:
        """End a fault; what it has set in a servo's error register stays until a reboot."""
        if fault.over:
            return
        fault.over = True
        self.simulation.disturb()
        if fault.kind is not Kind.CONDITION:
            return
        index, servo = self._struck(fault)
        if fault.name == "overheat":
            servo.forced_celsius = None
        elif fault.name == "voltage":
            servo.forced_volt = None
        elif fault.name == "silent":
            servo.silent = False
        elif fault.name == "encoder-stuck":
            servo.motor.stuck_at = None
        elif fault.name == "reversed":
            self.simulation.reverse(index)

    # The control channel

    def _answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Do what one request asks for; its first known key says what."""
        acts: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "inject": self._asked_to_inject,
            "clear": self._asked_to_clear,
            "unplug": self._asked_to_unplug,
            "replug": self._asked_to_replug,
            "state": self._asked_for_state,
            "goals": self._asked_for_goals,
            "positions": self._asked_for_positions,
        }
        for key, act in acts.items():
            if request.get(key):
                return act(request)
        raise BadRequest(f"no such request; send one of: {', '.join(acts)}")

    def _asked_to_inject(self, request: dict[str, Any]) -> dict[str, Any]:
        options = {key: value for key, value in request.items() if key != "inject"}
        fault = make(str(request["inject"]), options, self._ids, time.monotonic_ns())
        self._inject(fault)
        return {"fault": fault.as_dict()}

    def _asked_to_clear(self, request: dict[str, Any]) -> dict[str, Any]:
        name = request["clear"]
        cleared = self.faults.named(None if name is True else str(name))
        for fault in cleared:
            self._clear(fault)
        return {"cleared": [fault.name for fault in cleared]}

    def _asked_to_unplug(self, _: dict[str, Any]) -> dict[str, Any]:
        self._unplug()
        return {"link": None}

    def _asked_to_replug(self, request: dict[str, Any]) -> dict[str, Any]:
        name = request["replug"]
        link = self._link if name is True else self._link.parent / str(name)
        self._plug(link)
        return {"link": str(link)}

    def _asked_for_state(self, _: dict[str, Any]) -> dict[str, Any]:
        self.simulation.advance(time.monotonic_ns())
        segment = self.simulation.segment
        return {
            "link": None if self.port.link is None else str(self.port.link),
            "servos": [_servo_state(servo) for servo in self.simulation.servos],
            "bend_rad": (segment.u, segment.v),
            "tensions_n": segment.tensions_n,
            "instructions": self.wire.instructions,
            "cpu_s": time.process_time(),
            "faults": [fault.as_dict() for fault in self.faults.all],
        }

    def _asked_for_goals(self, request: dict[str, Any]) -> dict[str, Any]:
        since, rows = int(request.get("since_ns", 0)), int(request.get("rows", _ROWS))
        found = [
            (goal.received_ns, goal.executed_ns, list(goal.ticks.items()))
            for goal in self.wire.goals
            if goal.executed_ns >= since
        ]
        return {"goals": found[-rows:]}

    def _asked_for_positions(self, request: dict[str, Any]) -> dict[str, Any]:
        now_ns = time.monotonic_ns()
        self.simulation.advance(now_ns)
        since, rows = int(request.get("since_ns", 0)), int(request.get("rows", _ROWS))
        samples = self.simulation.samples
        found: list[Sample] = []
        for sample in reversed(samples):
            found.append(sample)
            # The one before tells where everything stood at the beginning.
            if sample.stamp_ns < since or len(found) >= rows:
                break
        found.reverse()
        return {"positions": found, "until_ns": now_ns}


def _servo_state(servo: Servo) -> dict[str, Any]:
    motor, registers = servo.motor, servo.registers
    return {
        "id": servo.number,
        "ticks": motor.position,
        "velocity": motor.velocity,
        "goal": registers["goal_position"],
        "torque": motor.torque,
        "load": motor.load,
        "hardware_error": registers["hardware_error_status"],
        "bus_watchdog": registers["bus_watchdog"],
        "tripped_ns": servo.tripped_ns,
        "operating_mode": registers["operating_mode"],
        "profile_velocity": registers["profile_velocity"],
        "baud_rate": servo.baud_rate,
    }


def serve(options: Options, stopped: Callable[[], bool], say: Callable[[str], None]) -> None:
    """Simulate servos until ``stopped()``.

    Args:
        options: see :class:`Options`.
        stopped: asked at least four times a second.
        say: told in one line when the port is there.

    Raises:
        LinkTaken: the port's name is not free.
        UnknownName, BadFault: the faults make no sense.
    """
    program = Program(options)
    if options.realtime:
        _prefer()
    gc.collect()
    gc.freeze()
    gc.disable()
    say(f"fake servos at {options.link}, control channel at {options.control}")
    program.run(stopped)


def _prefer() -> None:
    """Be in time also on a busy machine, where the system permits it."""
    if hasattr(os, "sched_setscheduler"):
        policy = os.SCHED_FIFO | getattr(os, "SCHED_RESET_ON_FORK", 0)
        try:
            os.sched_setscheduler(0, policy, os.sched_param(_PRIORITY))
        except OSError:
            return
