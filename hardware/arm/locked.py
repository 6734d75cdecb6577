"""An arm that stands: locked, or not there at all. Only the segment moves."""

from __future__ import annotations

import numpy as np

from hardware.arm.device import ArmReading
from hardware.devices import ARM


class LockedArm:
    """Joints that stand where they were put, whatever is commanded.

    For an instrument module on a stand, or on an arm that somebody locked at known angles.
    """

    def __init__(self, q: np.ndarray) -> None:
        """Stand at ``q`` (7,), rad."""
        self._q = q.copy()
        self._reading = ArmReading()

    def read(self, out_q: np.ndarray) -> ArmReading:
        """Exactly where it stands."""
        out_q[:] = self._q
        return self._reading

    def write(self, q: np.ndarray) -> None:
        """Ignored: it is locked."""

    def hold(self) -> None:
        """It always holds."""

    def release(self) -> None:
        """There is no torque to let go of."""

    def recover(self) -> None:
        """Nothing can go wrong with it."""

    def fill_devices(self, out: np.ndarray) -> None:
        """That it is locked."""
        out[0]["arm"] = np.zeros((), ARM)
        out[0]["arm"]["kind"] = b"locked"

    def close(self) -> None:
        """There is no device to give back."""
