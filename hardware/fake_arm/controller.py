"""What an xArm 7's controller does with its requests: modes, states, errors, and seven joints.

No sockets and no clock: time passes when it is told. Where the vendor's documentation is silent it
is strict: what a real controller might forgive is refused here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum

import numpy as np

from hardware.fake_arm.wire import Register, Request, Status

VERSION = "7,7,XF1300FAKE1,AC1300FAKE2,v1.12.10"
"""Axes, type, serial numbers of arm and controller, firmware, in the form the vendor's library
reads."""

SPEED_RAD_S = math.pi
"""A joint never goes faster."""

STEP_RAD = SPEED_RAD_S * 0.01
"""Further away than this from the last one, a streamed command asks for too much speed."""

LAG_S = 0.02
_REPLY_BYTES = 40
_ALL_JOINTS = 8


class Mode(IntEnum):
    """What the controller lets itself be told."""

    POSITION = 0
    SERVO = 1


class State(IntEnum):
    """Whether it moves, or could."""

    MOVING = 1
    READY = 2
    PAUSED = 3
    STOPPED = 4
    MODE_CHANGED = 5


class Error(IntEnum):
    """The errors that it finds by itself."""

    NONE = 0
    EMERGENCY_STOP = 1
    JOINT_LIMIT = 23
    SPEED_LIMIT = 24


class Warning(IntEnum):
    """The warnings that it gives."""

    NONE = 0
    BAD_PARAMETER = 12
    UNKNOWN_REGISTER = 13


class Controller:
    """An arm and its controller.

    Attributes:
        q: (7,) measured joints, rad.
        target: (7,) where they go, rad.
        mode, state, error, warning: as in the reports.
        enabled: whether the motors have torque; without it the brakes are closed.
        payload: mass in kg and centre of mass in mm, as it was told.
        collision_sensitivity: as it was told, 0 to 5.
        pressed: errors whose cause lasts; they cannot be cleaned away.
    """

    def __init__(self, q: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
        """Stand at ``q`` (7,), rad, with brakes closed.

        Args:
            q: joint angles.
            lower: (7,) lower joint limits, rad.
            upper: (7,) upper joint limits, rad.
        """
        self.q, self.target = q.astype(np.float64), q.astype(np.float64)
        self._lower, self._upper = lower, upper
        self.mode, self.state = int(Mode.POSITION), int(State.STOPPED)
        self.error, self.warning = int(Error.NONE), int(Warning.NONE)
        self.enabled = False
        self.payload = (0.0, 0.0, 0.0, 0.0)
        self.collision_sensitivity = 3
        self.pressed: set[int] = set()
        self._acts: dict[int, Callable[[bytes], bytes]] = {
            Register.GET_VERSION: lambda _: VERSION.encode().ljust(_REPLY_BYTES, b"\0"),
            Register.GET_SERIAL_NUMBER: self._serial_numbers,
            Register.SYSTEM_CONTROL: lambda _: b"",
            Register.MOTION_ENABLE: self._motion_enable,
            Register.SET_STATE: self._set_state,
            Register.GET_STATE: lambda _: bytes((self.state,)),
            Register.GET_COMMAND_COUNT: lambda _: b"\0\0",
            Register.GET_ERROR: lambda _: bytes((self.error, self.warning)),
            Register.CLEAN_ERROR: self._clean_error,
            Register.CLEAN_WARNING: self._clean_warning,
            Register.SET_MODE: self._set_mode,
            Register.SET_PAYLOAD: self._set_payload,
            Register.SET_COLLISION_SENSITIVITY: self._set_collision_sensitivity,
            Register.SET_TEACHING_SENSITIVITY: lambda _: b"",
            Register.GET_POSE: lambda _: np.zeros(6, "<f4").tobytes(),
            Register.GET_JOINTS: self._joints,
        }

    def handle(self, request: Request) -> tuple[int, bytes]:
        """Carry out one request; the status byte and the data of its answer."""
        if request.register == Register.MOVE_SERVO_JOINTS:
            return self._move_servo_joints(request.data), b""
        act = self._acts.get(request.register)
        if act is None:
            self.warning = Warning.UNKNOWN_REGISTER
            return self.status() | Status.INVALID, b""
        try:
            data = act(request.data)
        except (IndexError, ValueError):
            self.warning = Warning.BAD_PARAMETER
            return self.status() | Status.INVALID, b""
        return self.status(), data

    def status(self) -> int:
        """The status byte of an answer given now."""
        found = Status.FINE
        if self.error:
            found |= Status.ERROR
        if self.warning:
            found |= Status.WARNING
        if not self.enabled or self.state >= State.STOPPED:
            found |= Status.NOT_READY
        return int(found)

    def advance(self, seconds: float) -> None:
        """Let time pass: the joints go to their targets."""
        if not self.enabled or self.state >= State.PAUSED:
            return
        way = (self.target - self.q) * -math.expm1(-seconds / LAG_S)
        most = SPEED_RAD_S * seconds
        self.q += np.clip(way, -most, most)
        near = bool(np.all(np.abs(self.target - self.q) < 1e-6))
        self.state = int(State.READY if near else State.MOVING)

    def fail(self, error: int) -> None:
        """Stop with an error, under torque, except where the power is cut."""
        self.error = error
        if error == Error.EMERGENCY_STOP:
            self.enabled = False
        self._stop()

    def stop(self) -> None:
        """Stop as if somebody else had asked for it."""
        self._stop()

    def _stop(self) -> None:
        self.state = int(State.STOPPED)
        self.target[:] = self.q

    def _move_servo_joints(self, data: bytes) -> int:
        status = self.status()
        if status & (Status.ERROR | Status.NOT_READY):
            return status
        if self.mode != Mode.SERVO:
            return status | Status.INVALID
        if len(data) < 4 * 7:
            self.warning = Warning.BAD_PARAMETER
            return self.status() | Status.INVALID
        wanted = np.frombuffer(data, "<f4", 7).astype(np.float64)
        if not np.all(np.isfinite(wanted)):
            self.warning = Warning.BAD_PARAMETER
            return self.status() | Status.INVALID
        if np.any(wanted < self._lower) or np.any(wanted > self._upper):
            self.fail(Error.JOINT_LIMIT)
        elif np.any(np.abs(wanted - self.target) > STEP_RAD):
            self.fail(Error.SPEED_LIMIT)
        else:
            self.target[:] = wanted
            self.state = int(State.MOVING)
        return self.status()

    def _motion_enable(self, data: bytes) -> bytes:
        joint, enable = data[0], bool(data[1])
        if not 1 <= joint <= _ALL_JOINTS:
            raise ValueError(joint)
        self.enabled = enable and Error.EMERGENCY_STOP not in self.pressed
        self._stop()
        return b""

    def _set_state(self, data: bytes) -> bytes:
        if data[0] == State.STOPPED:
            self._stop()
        elif data[0] == State.PAUSED:
            self.state = int(State.PAUSED)
        elif data[0] != 0:
            raise ValueError(data[0])
        elif self.enabled and not self.error:
            self.state = int(State.READY)
        return b""

    def _set_mode(self, data: bytes) -> bytes:
        mode = Mode(data[0])
        if mode != self.mode:
            self.mode, self.state = int(mode), int(State.MODE_CHANGED)
            self.target[:] = self.q
        return b""

    def _clean_error(self, _: bytes) -> bytes:
        self.error = max(self.pressed, default=0)
        return b""

    def _clean_warning(self, _: bytes) -> bytes:
        self.warning = int(Warning.NONE)
        return b""

    def _set_payload(self, data: bytes) -> bytes:
        mass, x, y, z = np.frombuffer(data, "<f4", 4).tolist()
        self.payload = (mass, x, y, z)
        return b""

    def _set_collision_sensitivity(self, data: bytes) -> bytes:
        if not 0 <= data[0] <= 5:
            raise ValueError(data[0])
        self.collision_sensitivity = data[0]
        return b""

    def _serial_numbers(self, _: bytes) -> bytes:
        arm, controller = VERSION.split(",")[2:4]
        return f"{arm}\0{controller}\0".encode().ljust(_REPLY_BYTES, b"\0")

    def _joints(self, data: bytes) -> bytes:
        parts = data[0] & 0x0F if data else 1
        if not 1 <= parts <= 3:
            raise ValueError(parts)
        values = np.zeros(7 * parts, "<f4")
        values[:7] = self.q
        return values.tobytes()
