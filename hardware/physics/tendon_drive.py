"""What turns the pulleys of the simulated robot: servos, or the tension-feedback unit."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from hardware.physics.actuation import turn_servos
from hardware.tension_unit.module import (
    MODULES,
    POSITION,
    STATE,
    TORQUE,
    UnitFault,
    drive_unit,
    rest,
    unit_constants,
)
from robot.configuration import Configuration
from robot.tension.records import TendonMode


class TendonDrive(Protocol):
    """Turns the pulleys by one step of the simulation, and says what it measures."""

    measures_tension: bool

    def take(self, modes: np.ndarray, tension: np.ndarray) -> None:
        """From now on hold what ``modes`` (4,), each a TendonMode, say: an angle, or a tension of
        ``tension`` (4,) in N.
        """

    def turn(self, drives: np.ndarray, length: np.ndarray) -> None:
        """One step: ``servo`` of the (1,) drives follows ``servo_wanted``; lengths (4,) in m."""

    def measure(self, drives: np.ndarray, servo: np.ndarray, tension: np.ndarray) -> None:
        """Fill servo angles (4,) in rad and, where it measures them, tensions (4,) in N."""


class ServoDrive:
    """Position servos that know nothing of tension.

    Args:
        constants: (1,) of the actuation.
    """

    measures_tension = False

    def __init__(self, constants: np.ndarray) -> None:
        self._constants = constants

    def take(self, modes: np.ndarray, tension: np.ndarray) -> None:
        """Servos hold angles, whatever they are told."""

    def turn(self, drives: np.ndarray, length: np.ndarray) -> None:
        """The servos follow with their lag."""
        turn_servos(drives, self._constants)

    def measure(self, drives: np.ndarray, servo: np.ndarray, tension: np.ndarray) -> None:
        """Where the servos stand; what the tendons carry is left as it is."""
        servo[:] = drives["servo"][0]


class UnitDrive:
    """The tension-feedback unit, its drives in position or torque mode.

    Angles commanded and measured are of the servos' pulleys, which the controller thinks in; the
    unit's own pulleys are larger. Its zero is found with the straight segment, teeth in contact.

    Args:
        configuration: of the unit and of the module whose servos it stands for.
        constants: (1,) of the actuation, with tendons and step.
        generator: noise of cells and currents, offsets and gains.
    """

    measures_tension = True

    def __init__(
        self, configuration: Configuration, constants: np.ndarray, generator: np.random.Generator
    ) -> None:
        first = constants[0]
        self._unit = unit_constants(
            configuration.tension_unit,
            generator,
            first["tendon_stiffness"],
            first["tendon_length"],
            first["pretension"],
        )
        self._state, self._step_s = np.zeros(1, STATE), float(first["step_s"])
        rest(self._state, self._unit, np.zeros(MODULES))
        self._zero = self._state["seen"][0].copy()
        self._radius, self._ratio = float(self._unit["radius"][0]), float(self._unit["ratio"][0])
        self._per_servo = float(first["pulley_radius"]) / self._radius
        self._modes, self._torque = np.full(MODULES, POSITION), np.zeros(MODULES)
        self._by_torque = np.zeros(MODULES, dtype=bool)
        self._wanted, self._generator = np.empty(MODULES), generator

    def take(self, modes: np.ndarray, tension: np.ndarray) -> None:
        """The drives change their mode with the next cycle, without a jump of their current."""
        np.equal(modes, TendonMode.TENSION, out=self._by_torque)
        self._modes[:] = POSITION
        self._modes[self._by_torque] = TORQUE
        # A cell reads the gear's torque, which winds up where it is negative.
        np.multiply(tension, -self._radius, out=self._torque)

    def turn(self, drives: np.ndarray, length: np.ndarray) -> None:
        """One cycle of the unit's drives."""
        np.multiply(drives["servo_wanted"][0], self._per_servo, out=self._wanted)
        # The encoder counts from where the teeth touched.
        self._wanted += self._zero / self._ratio
        np.copyto(self._wanted, self._torque, where=self._by_torque)
        noise = self._generator.normal(size=(2, MODULES))
        drive_unit(self._state, self._unit, self._modes, self._wanted, length, self._step_s, noise)
        drives["servo"][0] = self._state["angle"][0] / self._per_servo
        self._by_encoders(drives["servo_reference"][0])

    def break_module(self, module: int, fault: UnitFault) -> None:
        """Break ``module`` (0 to 3) from the next cycle on; ``UnitFault.NONE`` mends it."""
        self._state["fault"][0, module] = fault

    def _by_encoders(self, servo: np.ndarray) -> None:
        np.subtract(self._state["seen"][0], self._zero, out=servo)
        servo /= self._ratio * self._per_servo

    def measure(self, drives: np.ndarray, servo: np.ndarray, tension: np.ndarray) -> None:
        """What encoders and torque cells say; T = torque / r (paper 3, II-B)."""
        self._by_encoders(servo)
        np.multiply(self._state["cell"][0], -1.0 / self._radius, out=tension)
