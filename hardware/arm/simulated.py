"""A simulated arm beside real servos: joints that follow their commands with a lag."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from hardware.arm.device import ArmReading
from hardware.devices import ARM
from hardware.physics.preset import Preset
from robot.records import Readiness

_FOLLOWING = ArmReading()
_HOLDING = ArmReading(readiness=int(Readiness.TORQUE_OFF))


class SimulatedArm:
    """Each joint follows its command with the time constant of its own servo.

    Between two readings the lag is integrated exactly, so that the same commands at the same times
    always give the same joints, and late ticks change nothing.
    """

    def __init__(
        self,
        q: np.ndarray,
        preset: Preset,
        speed_rad_s: np.ndarray,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Stand at ``q`` (7,), rad.

        Args:
            q: joint angles at the start.
            preset: tells the joints' lags.
            speed_rad_s: (7,) largest speed of each joint.
            clock: ns; asked once in every reading.
        """
        self._q, self._wanted = q.copy(), q.copy()
        self._lag = preset.joint_lag_s
        self._speed = tuple(float(speed) for speed in speed_rad_s)
        self._clock = clock
        self._then = clock()
        self._holding = False

    def read(self, out_q: np.ndarray) -> ArmReading:
        """Where the lag lets it be by now."""
        now = self._clock()
        dt = max(now - self._then, 0) * 1e-9
        self._then = now
        for joint in range(7):
            way = self._wanted[joint] - self._q[joint]
            step = way * -math.expm1(-dt / self._lag[joint])
            most = self._speed[joint] * dt
            self._q[joint] += min(max(step, -most), most)
        out_q[:] = self._q
        return _HOLDING if self._holding else _FOLLOWING

    def write(self, q: np.ndarray) -> None:
        """Follow ``q`` from now on, unless it holds."""
        if not self._holding:
            self._wanted[:] = q

    def hold(self) -> None:
        """Stand where it is until :meth:`recover`."""
        self._holding = True
        self._wanted[:] = self._q

    def release(self) -> None:
        """The brakes close: the same as holding."""
        self.hold()

    def recover(self) -> None:
        """Follow commands again, from where it stands."""
        self._holding = False

    def fill_devices(self, out: np.ndarray) -> None:
        """That it is simulated."""
        out[0]["arm"] = np.zeros((), ARM)
        out[0]["arm"]["kind"] = b"simulated"

    def close(self) -> None:
        """There is no device to give back."""
