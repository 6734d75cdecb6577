"""What every arm looks like to the plant: the ``ArmDevice`` interface."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np


class ArmReading(NamedTuple):
    """What an arm says of itself.

    Attributes:
        valid: whether the joints were measured, and lately.
        age_s: age of the measured joints, s.
        event: the ``robot.safety.Event`` that it tells as long as its cause lasts; 0 for none.
        readiness: a ``robot.records.Readiness``; 0 if it may be enabled.
    """

    valid: bool = True
    age_s: float = 0.0
    event: int = 0
    readiness: int = 0


class ArmDevice(Protocol):
    """An arm of seven joints. Nothing here blocks or waits; angles are in rad.

    A thread of its own may stand behind it. After :meth:`hold` or :meth:`release`, and after an
    error of its controller, commands are ignored until :meth:`recover`.
    """

    def read(self, out_q: np.ndarray) -> ArmReading:
        """Fill ``out_q`` (7,) with the measured joints, rad; called once in a tick."""

    def write(self, q: np.ndarray) -> None:
        """Go to ``q`` (7,), rad, by the next tick."""

    def hold(self) -> None:
        """Stop, and stay under torque."""

    def release(self) -> None:
        """Let go of torque: the brakes close. A separate act, never a default."""

    def recover(self) -> None:
        """Make it ready to be commanded again, from where it stands; it does not move."""

    def fill_devices(self, out: np.ndarray) -> None:
        """Fill the arm's part of a (1,) ``hardware.devices.DEVICES``, for people to see."""

    def close(self) -> None:
        """Stop, and give the device back."""
