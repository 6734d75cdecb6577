"""What a simulated plant says where it is asked about devices that it does not have."""

from __future__ import annotations

import numpy as np


class Wireless:
    """A plant without wires: always homed, never to be rebooted, holding as long as it lives."""

    def take_hold(self) -> None:
        """It never let go."""

    def home(self) -> None:
        """It knows its zero."""

    def reboot(self) -> None:
        """Nothing in it takes itself out of service."""

    def fill_devices(self, devices: np.ndarray) -> None:
        """Zeros: simulated.

        Args:
            devices: (1,) ``hardware.devices.DEVICES``.
        """
        devices[0] = np.zeros((), devices.dtype)
