"""The exact kinematic plant: goes where it is told, at once. For tests of the algebra."""

from __future__ import annotations

import numpy as np

from hardware.plant import Actuator, Measurement, PlantSpec
from hardware.wireless import Wireless
from robot.configuration import Configuration
from robot.forward import ForwardKinematics
from robot.parameters import parameters
from robot.records import ARM_JOINTS, SERVOS, TRACKER
from robot.tendons import bend_from_servos, servo_angles
from robot.urdf import urdf_text
from scenes.boards.board import Board


class KinematicPlant(Wireless):
    """Joints and servos that stand exactly where the last command put them."""

    def __init__(self, configuration: Configuration, x: np.ndarray) -> None:
        """Start at the augmented configuration ``x`` (10,)."""
        joints = tuple(Actuator(joint.name, "rad") for joint in configuration.arm.joints)
        servos = tuple(Actuator(f"servo{index}", "rad") for index in range(1, SERVOS + 1))
        self.spec = PlantSpec(
            "kinematic", joints + servos, round(1e9 / configuration.control.rate_hz), True
        )
        self._parameters = parameters(configuration)
        p = self._parameters[0]
        self._pitch, self._pulley = float(p["pitch_radius"]), float(p["pulley_radius"])
        self._forward = ForwardKinematics(urdf_text(configuration), self._parameters)
        self._q = x[:ARM_JOINTS].copy()
        self._servo = np.empty(SERVOS)
        servo_angles(x[7], x[8], self._pitch, self._pulley, self._servo)
        self._next_q, self._next_servo = self._q.copy(), self._servo.copy()
        self._measurement = Measurement(
            self._q, self._servo, np.zeros(SERVOS), np.zeros((), TRACKER), np.zeros(SERVOS)
        )

    def read(self) -> Measurement:
        """Exactly where it stands."""
        return self._measurement

    def write(self, command: np.ndarray) -> None:
        """Take the command; it is carried out by :meth:`advance`."""
        self._next_q[:] = command["q"][0]
        self._next_servo[:] = command["servo"][0]

    def advance(self) -> int:
        """Jump to the command."""
        self._q[:] = self._next_q
        self._servo[:] = self._next_servo
        return self.spec.tick_ns

    def hold(self) -> None:
        """Forget a command that has not been carried out."""
        self._next_q[:] = self._q
        self._next_servo[:] = self._servo

    def release(self) -> None:
        """Without weight or springs, letting go changes nothing: the same as holding."""
        self.hold()

    def close(self) -> None:
        """There are no devices to give back."""

    def change_board(self, board: Board) -> None:
        """Nothing touches anything here."""

    def register_trocar(self, position: np.ndarray) -> None:
        """Nothing to note: the controller's kinematics are exact."""

    def truth(self, truth: np.ndarray) -> bool:
        """Forward kinematics of where it stands, through servos and tendons."""
        u, v = bend_from_servos(self._servo, self._pitch, self._pulley)
        self._forward.fill(truth, self._q, u, v)
        return True
