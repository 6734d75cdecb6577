"""What every robot looks like to the control loop: the ``Plant`` interface."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from scenes.boards.board import Board


class Actuator(NamedTuple):
    """One driven axis: its name and the unit of its position."""

    name: str
    unit: str


class PlantSpec(NamedTuple):
    """What a plant is.

    Attributes:
        name: short name, shown to people.
        actuators: in the order of the command: seven joints, four servos.
        tick_ns: how much plant time one tick takes.
        simulated: True if the plant owns the clock and knows its own truth.
    """

    name: str
    actuators: tuple[Actuator, ...]
    tick_ns: int
    simulated: bool


class Measurement(NamedTuple):
    """What the robot's own sensors say. The arrays belong to the plant and change with it.

    Attributes:
        q: (7,) joint angles, rad.
        servo: (4,) servo angles, rad.
        tension: (4,) tendon tension, N; NaN of a cell without a reading.
        tracker: () ``robot.records.TRACKER``: the newest tip pose, ``sequence`` 0 without one.
        load: (4,) load of each servo, share of its largest, -1 to 1.
        tension_cells: whether torque cells measure the tensions.
        contact_n: largest contact force on the instrument that a sensor reads, N.
        valid: whether every device answered.
        age_s: age of the oldest value, s.
        event: the :class:`robot.safety.Event` that a device tells as long as its cause lasts; 0 for
            none.
        readiness: the :class:`robot.records.Readiness` of the devices.
    """

    q: np.ndarray
    servo: np.ndarray
    tension: np.ndarray
    tracker: np.ndarray
    load: np.ndarray
    tension_cells: bool = False
    contact_n: float = 0.0
    valid: bool = True
    age_s: float = 0.0
    event: int = 0
    readiness: int = 0


class Plant(Protocol):
    """A robot, simulated or real. Nothing here blocks."""

    spec: PlantSpec

    def read(self) -> Measurement:
        """The newest measurement."""

    def write(self, command: np.ndarray) -> None:
        """Take a (1,) ``robot.records.COMMAND``."""

    def advance(self) -> int:
        """Let one tick pass; how many nanoseconds it took."""

    def hold(self) -> None:
        """Stay where it is, under torque."""

    def release(self) -> None:
        """Let go of torque on every device, also past one that does not answer. A separate act,
        never a default.
        """

    def take_hold(self) -> None:
        """Put torque on where it stands, after :meth:`release`."""

    def home(self) -> None:
        """Begin to find the tendons' zero; ``readiness`` tells when it is done. Only while the
        robot is DISABLED.
        """

    def reboot(self) -> None:
        """Start devices anew that took themselves out of service. Only while nothing moves."""

    def fill_devices(self, devices: np.ndarray) -> None:
        """Fill a (1,) ``hardware.devices.DEVICES``: what people want to know of the devices."""

    def close(self) -> None:
        """Give the devices back."""

    def change_board(self, board: Board) -> None:
        """Put another board before the instrument. Only while the robot is DISABLED; may take
        longer than a tick.
        """

    def register_trocar(self, position: np.ndarray) -> None:
        """The trocar is registered now, by the shaft or the tip standing there.

        A plant whose kinematics differ from the controller's notes by how much, for :meth:`truth`.

        Args:
            position: (3,) point of the shaft's axis nearest to the trocar, or the tip where it
                touched, as the controller knows it; base frame, m.
        """

    def truth(self, truth: np.ndarray) -> bool:
        """Fill all but the errors of a (1,) ``robot.records.TRUTH``; False if the truth is unknown.

        For reports only, never for control. ``trocar_position`` holds the trocar that the
        controller was told, and is changed where the plant knows better.
        """
