"""The real xArm 7, behind the same interface as every arm."""

from __future__ import annotations

import time

import numpy as np

from hardware.arm.address import arm_address
from hardware.arm.device import ArmReading
from hardware.arm.follower import Follower
from hardware.arm.report_reader import ReportReader
from hardware.arm.session import ArmSession
from hardware.arm.worker import ArmWorker, Settings, Stage, Wish
from hardware.devices import DeviceState
from robot.configuration import Configuration
from robot.records import Readiness
from robot.safety import Event

LOST_S = 0.045
"""Reports come every 10 ms; four that are missing mean that the connection is gone. It must be told
before the measurement counts as too old."""

NEAR_RAD = 0.02
"""A first command further away from where a joint stands is not followed."""

_CATCH_UP = 1.25
"""How much faster than the controller's own limit a joint may go after a late command."""

_OUTSIDE_RAD = 0.01

_READINESS = {
    Stage.SEARCHING: Readiness.NOT_CONNECTED,
    Stage.PREPARING: Readiness.BUSY,
    Stage.READY: Readiness.READY,
    Stage.HELD: Readiness.TORQUE_OFF,
    Stage.RELEASED: Readiness.TORQUE_OFF,
    Stage.FAULT: Readiness.DEVICE_FAULT,
}
_EVENTS = {Stage.SEARCHING: Event.ARM_LOST, Stage.FAULT: Event.ARM_FAULT}
_STATES = {
    Stage.SEARCHING: DeviceState.SEARCHING,
    Stage.PREPARING: DeviceState.PREPARING,
    Stage.FAULT: DeviceState.FAULT,
}


class XArm:
    """An xArm 7 on its controller. A thread of its own talks to it; nothing here waits.

    It is looked for until it is found. The first time it is prepared by itself (brakes open, servo
    mode, standing); after a lost connection it is taken as it is. An error of its controller lasts
    until :meth:`recover`. It begins to move only with commands that change and that are near to
    where it stands.
    """

    def __init__(self, configuration: Configuration, lost_s: float = LOST_S) -> None:
        """Begin to look for the controller.

        Args:
            configuration: tells address, rate, limits, and what the flange carries.
            lost_s: age of the newest report at which the connection counts as lost.

        Raises:
            ArmLibraryMissing: if the vendor's library is not installed.
            InvalidArmAddress: if the address is none.
        """
        hardware, joints = configuration.hardware, configuration.arm.joints
        self.address = arm_address(hardware.arm_address)
        lower = np.array([joint.lower_rad for joint in joints])
        upper = np.array([joint.upper_rad for joint in joints])
        self._lowest, self._highest = lower - _OUTSIDE_RAD, upper + _OUTSIDE_RAD
        self._judged, self._inside = -1, False
        fastest = _CATCH_UP * configuration.limits.joint_speed_rad_s
        speed = np.array([min(joint.speed_rad_s, fastest) for joint in joints])
        self._lost_ns = round(lost_s * 1e9)
        x, y, z = (1e3 * place for place in configuration.module.centre_of_mass_m)
        settings = Settings(
            period_ns=round(1e9 / hardware.arm_rate_hz),
            delay_ns=round(1e9 / configuration.control.rate_hz),
            lost_ns=self._lost_ns,
            mass_kg=configuration.module.mass_kg,
            centre_mm=(x, y, z),
            realtime=configuration.control.realtime != "off",
        )
        self._follower = Follower(
            lower,
            upper,
            speed / hardware.arm_rate_hz,
            NEAR_RAD,
            configuration.limits.tracking_error_rad,
        )
        self._reports = ReportReader(self.address, settings.realtime)
        session = ArmSession(self.address)
        self._worker = ArmWorker(session, self._reports, self._follower, settings)
        self._worker.start()

    def read(self, out_q: np.ndarray) -> ArmReading:
        """The newest report, and what the thread found; ``out_q`` stays where none ever came."""
        stamp = self._reports.newest(out_q)
        age = time.monotonic_ns() - stamp
        worker, stage = self._worker, self._worker.stage
        fresh = self._reports.connected and stamp != 0 and age <= self._lost_ns
        if not fresh and stage != Stage.SEARCHING:
            worker.doubt()
        if not fresh or worker.doubted or stage == Stage.SEARCHING:
            return ArmReading(fresh, age * 1e-9, Event.ARM_LOST, Readiness.NOT_CONNECTED)
        readiness = Readiness.BUSY if worker.recovering else _READINESS[stage]
        if readiness == Readiness.READY and not self._stands_inside(out_q):
            readiness = Readiness.OUTSIDE_LIMITS
        return ArmReading(True, age * 1e-9, _EVENTS.get(stage, Event.NOTHING), readiness)

    def write(self, q: np.ndarray) -> None:
        """Leave ``q`` (7,), rad, for the thread."""
        self._follower.put(time.monotonic_ns(), q)

    def hold(self) -> None:
        """End the stream at once, and stop the arm under torque until :meth:`recover`."""
        self._worker.wish(Wish.HOLD)

    def release(self) -> None:
        """End the stream at once, stop, and close the brakes."""
        self._worker.wish(Wish.RELEASE)

    def recover(self) -> None:
        """Clean errors and make it ready; it stands until commands change."""
        self._worker.wish(Wish.RECOVER)

    def fill_devices(self, out: np.ndarray) -> None:
        """Where it is, what it says, how old that is.

        Args:
            out: (1,) ``hardware.devices.DEVICES``.
        """
        arm, worker = out[0]["arm"], self._worker
        stage = Stage.SEARCHING if worker.doubted else worker.stage
        arm["state"] = _STATES.get(stage, DeviceState.CONNECTED)
        arm["error"], arm["warning"] = worker.error, worker.warning
        arm["rate_hz"] = worker.rate_hz if self._follower.following else 0.0
        reports = self._reports
        arm["age_ms"] = reports.age_ns() * 1e-6 if reports.received else 0.0
        arm["reconnects"] = worker.reconnects
        arm["kind"], arm["address"] = b"xarm", str(self.address).encode()
        arm["message"] = worker.message

    def close(self) -> None:
        """Stop the arm under torque, and disconnect."""
        self._worker.end()

    def _stands_inside(self, q: np.ndarray) -> bool:
        """Whether the joints of the newest report are inside their limits; judged once for each."""
        received = self._reports.received
        if received != self._judged:
            self._judged = received
            self._inside = bool(np.all((q >= self._lowest) & (q <= self._highest)))
        return self._inside
