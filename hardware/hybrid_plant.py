"""A robot of real parts: an arm and an instrument module, each behind a device of its own."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from hardware.arm.device import ArmDevice, ArmReading
from hardware.module.module import InstrumentModule, ModuleReading
from hardware.plant import Actuator, Measurement, PlantSpec
from robot.configuration import Configuration
from robot.records import ARM_JOINTS, SERVOS, TRACKER
from robot.safety import Event
from scenes.boards.board import Board

_SHORTEST, _LONGEST = 0.5, 2.0
"""What a tick may last, in periods: a late one is not made up for by a leap."""

_FAULTS = frozenset((Event.SERVO_SILENT, Event.SERVO_FAULT, Event.ARM_FAULT))


def gravest(arm: ArmReading, module: ModuleReading) -> int:
    """The event to tell of two devices: a fault before a loss, the servos' before the arm's."""
    for event in (module.event, arm.event):
        if event in _FAULTS:
            return event
    return module.event or arm.event


class HybridPlant:
    """Arm and module side by side. Both work in threads of their own; nothing here waits.

    It does not know its own truth: errors are desired minus measured. The board that stands in
    front of a real robot is whatever stands there.

    Args:
        configuration: names, rate, and which arm.
        arm: the arm.
        module: the instrument module on the servo bus.
        clock: the host's monotonic clock, ns.
    """

    def __init__(
        self,
        configuration: Configuration,
        arm: ArmDevice,
        module: InstrumentModule,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._arm, self._module, self._clock = arm, module, clock
        joints = tuple(Actuator(joint.name, "rad") for joint in configuration.arm.joints)
        servos = tuple(Actuator(f"servo{index}", "rad") for index in configuration.servos.ids)
        tick_ns = round(1e9 / configuration.control.rate_hz)
        name = f"{configuration.hardware.arm} arm, servos"
        self.spec = PlantSpec(name, joints + servos, tick_ns, False)
        self._shortest_ns = round(_SHORTEST * tick_ns)
        self._longest_ns = round(_LONGEST * tick_ns)
        self._q, self._servo = np.zeros(ARM_JOINTS), np.zeros(SERVOS)
        self._load = np.zeros(SERVOS)
        self._still = Measurement(
            self._q, self._servo, np.zeros(SERVOS), np.zeros((), TRACKER), self._load
        )
        self._newest = self._still
        self._then = clock()
        self._sense()

    def _sense(self) -> None:
        arm = self._arm.read(self._q)
        module = self._module.read(self._servo, self._load)
        self._newest = self._still._replace(
            valid=arm.valid and module.valid,
            age_s=max(arm.age_s, module.age_s),
            event=gravest(arm, module),
            readiness=module.readiness or arm.readiness,
        )

    def read(self) -> Measurement:
        """What arm and servos measured last."""
        return self._newest

    def write(self, command: np.ndarray) -> None:
        """Hand the command over; what is at rest is told so."""
        first = command[0]
        self._arm.write(first["q"])
        self._module.write(first["servo"], bool(first["moving"]))

    def advance(self) -> int:
        """Take in what the devices measured; how long it was since the last time, within limits."""
        now = self._clock()
        passed, self._then = now - self._then, now
        self._sense()
        return int(min(max(passed, self._shortest_ns), self._longest_ns))

    def hold(self) -> None:
        """Both stay where they are, under torque."""
        self._arm.hold()
        self._module.hold()

    def release(self) -> None:
        """Both let go; the module's failure does not keep the arm from it, nor the other way."""
        try:
            self._module.release()
        finally:
            self._arm.release()

    def take_hold(self) -> None:
        """Both put torque on where they stand."""
        self._arm.recover()
        self._module.take_hold()

    def home(self) -> None:
        """The module finds the tendons' zero; the arm needs none."""
        self._module.home()

    def reboot(self) -> None:
        """Servos that took themselves out of service start anew; the arm's errors are cleared."""
        self._arm.recover()
        self._module.reboot()

    def fill_devices(self, devices: np.ndarray) -> None:
        """What both tell people, (1,) ``hardware.devices.DEVICES``."""
        self._arm.fill_devices(devices)
        self._module.fill_devices(devices)

    def close(self) -> None:
        """Give both back."""
        try:
            self._module.close()
        finally:
            self._arm.close()

    def change_board(self, board: Board) -> None:
        """People put boards there; the picture shows which."""

    def register_trocar(self, position: np.ndarray) -> None:
        """Nothing to note: where the shaft truly is, nobody here knows better."""

    def truth(self, truth: np.ndarray) -> bool:
        """Unknown."""
        return False
