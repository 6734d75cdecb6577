"""The instrument module as the plant sees it. Nothing here blocks: a thread does the waiting."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from hardware.devices import TEXT
from hardware.module.module_servos import PATIENCE_S
from hardware.module.worker import Command, ModuleWorker, Order
from hardware.servos.control_table import TABLE
from robot.configuration import Configuration

_LOAD_UNIT = TABLE["present_load"].unit_scale
_VOLT_UNIT = TABLE["present_input_voltage"].unit_scale


class ModuleReading(NamedTuple):
    """What the module says of itself.

    Attributes:
        valid: whether all four servos were measured.
        age_s: age of the oldest of the four, s.
        event: the ``robot.safety.Event`` that it tells as long as its cause lasts; 0 without one.
        readiness: a ``robot.records.Readiness``; 0 if it may be enabled.
    """

    valid: bool
    age_s: float
    event: int
    readiness: int


class InstrumentModule:
    """Four servos that bend the segment.

    It connects by itself, also again and under another name, and never moves because of that: after
    anything that went wrong it holds, until the robot has rested and begins a motion from where the
    servos are.
    """

    def __init__(self, configuration: Configuration, patience_s: float = PATIENCE_S) -> None:
        """Begin to look for the servos; real-time scheduling as ``[control] realtime`` says.

        Args:
            configuration: of the bus and the module.
            patience_s: how late an answer of the servos may be.
        """
        realtime = configuration.control.realtime != "off"
        self._worker = ModuleWorker(configuration, realtime, patience_s)
        self._settings = configuration.servos

    def read(self, out_servo: np.ndarray, out_load: np.ndarray) -> ModuleReading:
        """Fill in the newest measurement.

        Args:
            out_servo: (4,) filled with servo angles, rad; 0 is the straight segment.
            out_load: (4,) filled with loads, share of the largest, -1 to 1; negative while a servo
                pulls its tendon.
        """
        snapshot = self._worker.snapshot
        out_servo[:] = snapshot.angles
        out_load[:] = snapshot.loads
        age_s = (time.monotonic_ns() - snapshot.stamp_ns) * 1e-9
        return ModuleReading(snapshot.valid, age_s, snapshot.event, snapshot.readiness)

    def write(self, servo: np.ndarray, moving: bool) -> None:
        """Go to these angles.

        Args:
            servo: (4,) rad.
            moving: whether they belong to a motion; at rest the servos keep the goals they have.
        """
        self._worker.command = Command(time.monotonic_ns(), tuple(servo.tolist()), moving)

    def hold(self) -> None:
        """Stay here, under torque."""
        self._worker.order(Order.HOLD)

    def release(self) -> None:
        """Let go of torque on every servo, also past one that does not answer."""
        self._worker.order(Order.RELEASE)

    def take_hold(self) -> None:
        """Put torque on where the servos stand."""
        self._worker.order(Order.TAKE_HOLD)

    def home(self) -> None:
        """Begin to make the tendons taut and find their zero; ``readiness`` is BUSY meanwhile."""
        self._worker.order(Order.HOME)

    def reboot(self) -> None:
        """Start servos anew that switched themselves off. All lose torque: home afterwards."""
        self._worker.order(Order.REBOOT)

    def fill_devices(self, out: np.ndarray) -> None:
        """Fill ``bus`` of a (1,) ``hardware.devices.DEVICES``."""
        worker, bus = self._worker, out[0]["bus"]
        times, servos, counters = worker.times, worker.servos, worker.counters
        homing, prepared, cycle = servos.homing, servos.prepared, servos.cycle
        bus["state"], bus["homed"] = int(worker.state), servos.homed
        bus["homing_progress"] = homing.progress if homing is not None else 0.0
        bus["baud_rate"] = self._settings.baud_rate
        bus["rate_hz"], bus["cpu_percent"] = times.rate_hz, times.cpu_percent
        bus["cycle_median_ms"], bus["cycle_p99_ms"] = times.median_ms, times.p99_ms
        bus["cycles"], bus["missed"] = times.cycles, times.missed
        bus["bad_packets"] = counters.damaged + counters.strays
        bus["reconnects"] = worker.reconnects
        bus["port"], bus["message"] = _text(worker.port), _text(servos.message)
        now_ns, snapshot = time.monotonic_ns(), worker.snapshot
        for index, number in enumerate(self._settings.ids):
            servo = bus["servos"][index]
            servo["id"], servo["torque"] = number, servos.torque[index]
            servo["hardware_error"] = int(servos.errors[index])
            servo["position_deg"] = np.degrees(snapshot.angles[index])
            if prepared is not None:
                servo["model"] = prepared.found[index].model
                servo["firmware"] = prepared.found[index].firmware
            servo["answers"] = cycle is not None and servos.watch.missed[index] == 0
            servo["age_ms"] = (now_ns - servos.stamps_ns[index]) * 1e-6 if prepared else 0.0
            if cycle is not None:
                servo["load_percent"] = 100.0 * snapshot.loads[index]
                servo["voltage_v"] = cycle.voltage[index] * _VOLT_UNIT
                servo["temperature_c"] = cycle.temperature[index]

    def close(self) -> None:
        """End: the servos hold under torque."""
        self._worker.close()


def _text(message: str) -> bytes:
    """As much of a message as fits, without half a character."""
    return message.encode()[:TEXT].decode(errors="ignore").encode()
