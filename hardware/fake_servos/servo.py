"""One XL430-W250: its control table, its watchdog, its protections, and what it answers.

Everything here happens at times in ns that are told to it; nothing looks at a clock.
Source: ROBOTIS e-manual, XL430-W250, firmware 46.
"""

from __future__ import annotations

import math
import struct

from hardware.fake_servos.motor import (
    ACCELERATION_UNIT,
    LARGEST_PWM,
    NOMINAL_VOLT,
    VELOCITY_UNIT,
    Motor,
)
from hardware.fake_servos.registers import Registers
from hardware.servos.control_table import (
    BAUD_RATES,
    CENTRE_TICK,
    PRESENT,
    RETURN_DELAY_UNIT_US,
    TABLE,
    TICKS_PER_TURN,
    WATCHDOG_TRIPPED,
    WATCHDOG_UNIT_MS,
    HardwareError,
    OperatingMode,
    Register,
)
from hardware.servos.protocol import ALERT, StatusError

BOOT_NS = 150_000_000
"""How long a servo is deaf after a reboot."""

_OVERLOAD_SHARE, _OVERLOAD_SECONDS = 0.95, 1.0
_AMBIENT_C, _HEAT_C, _THERMAL_SECONDS = 28.0, 60.0, 180.0
_REVERSE_MODE, _TIME_PROFILE = 0x01, 0x04
_CLEAR_TURNS = b"\x01DXL\x22"
_FIRST, _END = PRESENT
_NOW = TABLE["realtime_tick"].address
_PRESENT_FORM = struct.Struct("<HBBhhiiiiHB")
"""Registers 120 to 146: tick, moving, moving status, PWM, load, velocity, position, both
trajectories, voltage, temperature."""
_LIMITS = {
    *("profile_velocity", "profile_acceleration", "goal_pwm", "pwm_limit"),
    *("position_p_gain", "operating_mode", "drive_mode"),
}
"""Registers whose numbers the motor uses."""

_POSITION_MODES = {OperatingMode.POSITION, OperatingMode.EXTENDED_POSITION}

Answer = tuple[int, bytes]
"""Error byte and data of a status."""


class Servo:
    """One servo on the bus.

    Args:
        number: its id.
        baud_rate: one of ``BAUD_RATES``.
        tick: where its shaft stands at first.

    Attributes:
        registers: its control table.
        motor: its motion.
        silent: whether it neither hears nor answers; it goes on with what it was doing.
        forced_volt: supply that stands in place of the real one, or None.
        forced_celsius: temperature likewise.
        tripped_ns: when its watchdog stopped it last, or 0.
    """

    def __init__(self, number: int, baud_rate: int, tick: float = CENTRE_TICK) -> None:
        self.registers = Registers()
        self.registers["id"] = number
        self.registers["baud_rate"] = BAUD_RATES.index(baud_rate)
        self.motor = Motor(tick)
        self.silent = False
        self.forced_volt: float | None = None
        self.forced_celsius: float | None = None
        self.tripped_ns = 0
        self._turns = 0
        self._homing_offset = 0
        self._celsius = _AMBIENT_C + 4.0
        self._overloaded_s = 0.0
        self._heard_ns = 0
        self._deaf_until_ns = 0
        self._registered: list[tuple[Register, int]] | None = None
        self._boot()

    @property
    def number(self) -> int:
        """Its id."""
        return self.registers.memory[TABLE["id"].address]

    @property
    def baud_rate(self) -> int:
        """Bits per second that it understands."""
        return BAUD_RATES[self.registers["baud_rate"]]

    @property
    def return_delay_ns(self) -> int:
        """How long it waits before it answers."""
        return self.registers["return_delay_time"] * RETURN_DELAY_UNIT_US * 1000

    def listens(self, now_ns: int) -> bool:
        """Whether it takes part in what happens on the bus."""
        return not self.silent and now_ns >= self._deaf_until_ns

    def _boot(self) -> None:
        self.registers.boot()
        self._registered = None
        self._overloaded_s = 0.0
        self.motor.torque = False
        self.motor.mode = self.registers["operating_mode"]
        self._turns = 0
        self._take_position()
        self._set_limits()

    def _take_position(self) -> None:
        """Count ticks anew, as every change of torque and mode does."""
        if self.registers["operating_mode"] == OperatingMode.POSITION:
            self._turns = TICKS_PER_TURN * math.floor(self.motor.encoder / TICKS_PER_TURN)
        self.motor.halt()
        self.registers["goal_position"] = self._shown(self.motor.encoder)

    def _shown(self, position: float) -> int:
        """Motor ticks as the registers count them."""
        memory = self.registers.memory
        counted = round(position) - self._turns
        if memory[10] & _REVERSE_MODE:
            counted = -counted
            if memory[11] == OperatingMode.POSITION:
                counted %= TICKS_PER_TURN
        return counted + self._homing_offset

    def _meant(self, shown: int) -> float:
        """Motor ticks of a number in ``goal_position``."""
        memory = self.registers.memory
        counted = shown - self._homing_offset
        if memory[10] & _REVERSE_MODE:
            counted = -counted
            if memory[11] == OperatingMode.POSITION:
                counted %= TICKS_PER_TURN
        return float(counted + self._turns)

    # Time

    def step(self, now_ns: int, seconds: float, outer_load: float) -> None:
        """Move for ``seconds`` up to ``now_ns`` under a torque from outside (share of stall)."""
        self._watch(now_ns)
        motor = self.motor
        motor.volt = NOMINAL_VOLT if self.forced_volt is None else self.forced_volt
        motor.step(seconds, outer_load)
        heat = _AMBIENT_C + _HEAT_C * motor.load**2 - self._celsius
        self._celsius += heat * seconds / _THERMAL_SECONDS
        if motor.torque and abs(motor.drive) >= _OVERLOAD_SHARE:
            self._overloaded_s += seconds
        else:
            self._overloaded_s = 0.0
        self.protect()

    def _watch(self, now_ns: int) -> None:
        """Stop when the host has been silent for longer than the watchdog allows."""
        allowed = self.registers.memory[98]
        if not allowed or not self.motor.torque or allowed > 127:
            return
        if now_ns - self._heard_ns > allowed * WATCHDOG_UNIT_MS * 1_000_000:
            self.registers["bus_watchdog"] = WATCHDOG_TRIPPED
            self.motor.halt()
            self.tripped_ns = now_ns

    def watchdog_ns(self) -> int:
        """When the watchdog would stop it if nothing was said any more; 0 for never."""
        allowed = self.registers.memory[98]
        if not allowed or allowed > 127 or not self.motor.torque:
            return 0
        return self._heard_ns + allowed * WATCHDOG_UNIT_MS * 1_000_000

    def protect(self) -> None:
        """Notice what is wrong with supply, temperature and load, and let torque go if told to."""
        registers, found = self.registers, 0
        if self.forced_volt is not None:
            decivolt = round(self.forced_volt * 10.0)
            low, high = registers["min_voltage_limit"], registers["max_voltage_limit"]
            if not low <= decivolt <= high:
                found |= HardwareError.INPUT_VOLTAGE
        celsius = self._celsius if self.forced_celsius is None else self.forced_celsius
        if celsius > registers.memory[31]:
            found |= HardwareError.OVERHEATING
        if self._overloaded_s > _OVERLOAD_SECONDS:
            found |= HardwareError.OVERLOAD
        if found:
            self.fail(HardwareError(found))

    def fail(self, error: HardwareError) -> None:
        """Set bits of ``hardware_error_status``; those in the mask ``shutdown`` cut the torque."""
        registers = self.registers
        registers["hardware_error_status"] |= error
        if error & registers["shutdown"] and self.motor.torque:
            registers["torque_enable"] = 0
            self.motor.torque = False
            self.motor.halt()

    # The bus

    def hear(self, now_ns: int) -> None:
        """Notice that an instruction went over the bus, for whomever."""
        self._heard_ns = now_ns

    def _answer(self, error: int, data: bytes = b"") -> Answer:
        alert = ALERT if self.registers.memory[70] else 0
        return error | alert, data

    def refuse(self, error: StatusError) -> Answer:
        """A status that says why nothing was done."""
        return self._answer(error)

    def ping(self) -> Answer:
        """Model number and firmware version."""
        memory = self.registers.memory
        return self._answer(0, bytes((memory[0], memory[1], memory[6])))

    def read(self, now_ns: int, address: int, size: int) -> Answer:
        """Some bytes of the control table, as they are now."""
        if address + size > _NOW:
            self._refresh(now_ns)
        data = self.registers.read(address, size)
        return self._answer(StatusError.ACCESS) if data is None else self._answer(0, data)

    def write(self, now_ns: int, address: int, data: bytes) -> Answer:
        """Change registers; all of them or, with an error, none."""
        error, values = self.registers.check(address, data)
        if error:
            return self._answer(error)
        return self._answer(self._take(now_ns, values))

    def register_write(self, address: int, data: bytes) -> Answer:
        """Keep a write for :meth:`action`."""
        error, values = self.registers.check(address, data)
        if not error:
            self._registered = values
            self.registers["registered_instruction"] = 1
        return self._answer(error)

    def action(self, now_ns: int) -> Answer:
        """Do what was registered."""
        values, self._registered = self._registered, None
        if values is None:
            return self._answer(StatusError.INSTRUCTION)
        self.registers["registered_instruction"] = 0
        return self._answer(self._take(now_ns, values))

    def reboot(self, now_ns: int) -> Answer:
        """Start anew: torque off, errors gone, RAM as after power-on."""
        answer = self._answer(0)
        self._deaf_until_ns = now_ns + BOOT_NS
        self._boot()
        return answer

    def clear(self, data: bytes) -> Answer:
        """Forget whole turns, if it stands still."""
        if data != _CLEAR_TURNS or abs(self.motor.velocity) > 1.0:
            return self._answer(StatusError.RESULT_FAIL)
        self._turns = TICKS_PER_TURN * math.floor(self.motor.encoder / TICKS_PER_TURN)
        self.motor.halt()
        return self._answer(0)

    def _take(self, now_ns: int, values: list[tuple[Register, int]]) -> StatusError:
        for register, value in values:
            error = self._take_one(now_ns, register, value)
            if error:
                return error
        return StatusError.NONE

    def _take_one(self, now_ns: int, register: Register, value: int) -> StatusError:
        registers, motor, name = self.registers, self.motor, register.name
        if (
            name == "torque_enable"
            and value
            and registers["hardware_error_status"] & registers["shutdown"]
        ):
            # Only a reboot gets it out of a shutdown.
            return StatusError.RESULT_FAIL
        place = register.address
        registers.memory[place : register.end] = register.encode(value)
        if name == "goal_position":
            self._aim(value)
        elif name == "torque_enable":
            if motor.torque != bool(value):
                motor.torque = bool(value)
                self._take_position()
            self.hear(now_ns)
        elif name == "goal_velocity" and motor.mode == OperatingMode.VELOCITY:
            motor.goal = value * VELOCITY_UNIT
        elif name in {"operating_mode", "homing_offset", "drive_mode"}:
            motor.mode = registers["operating_mode"]
            self._homing_offset = registers["homing_offset"]
            self._take_position()
        if name in _LIMITS:
            self._set_limits()
        return StatusError.NONE

    def _aim(self, shown: int) -> None:
        """Begin the way to a new goal position."""
        registers, motor = self.registers, self.motor
        if not motor.torque or motor.mode not in _POSITION_MODES:
            return
        motor.goal = self._meant(shown)
        if registers.memory[10] & _TIME_PROFILE and registers["profile_velocity"]:
            span = registers["profile_velocity"] / 1000.0
            rise = min(registers["profile_acceleration"] / 1000.0, 0.5 * span)
            way = abs(motor.goal - motor.trajectory)
            motor.largest_velocity = max(way / max(span - rise, 1e-3), 1.0)
            motor.acceleration = motor.largest_velocity / rise if rise else 0.0

    def _set_limits(self) -> None:
        """Hand profile, gain and output limit to the motor."""
        registers, motor = self.registers, self.motor
        pwm = registers["goal_pwm"] / LARGEST_PWM
        bound = registers["pwm_limit"] / LARGEST_PWM
        motor.pwm = min(max(pwm, -bound), bound)
        motor.gain = registers["position_p_gain"]
        if not registers["drive_mode"] & _TIME_PROFILE:
            motor.largest_velocity = registers["profile_velocity"] * VELOCITY_UNIT
            motor.acceleration = registers["profile_acceleration"] * ACCELERATION_UNIT

    def _refresh(self, now_ns: int) -> None:
        """Write what the servo measures into its table."""
        motor, memory = self.motor, self.registers.memory
        sign = -1 if memory[10] & _REVERSE_MODE else 1
        encoder = motor.encoder
        stuck = motor.stuck_at is not None
        ongoing = motor.trajectory != motor.goal and motor.torque
        in_place = abs(motor.goal - encoder) < 10.0
        kind = 0 if not motor.largest_velocity else (0x30 if motor.acceleration else 0x10)
        volt = NOMINAL_VOLT if self.forced_volt is None else self.forced_volt
        celsius = self._celsius if self.forced_celsius is None else self.forced_celsius
        velocity = 0.0 if stuck else motor.velocity
        moving = abs(velocity) > self.registers["moving_threshold"] * VELOCITY_UNIT
        _PRESENT_FORM.pack_into(
            memory,
            _NOW,
            now_ns // 1_000_000 % 32_768,
            int(moving),
            kind | (0x02 if ongoing else 0) | (0x01 if in_place else 0),
            sign * round(motor.drive * LARGEST_PWM) if motor.torque else 0,
            sign * round(1000.0 * min(max(motor.load, -1.0), 1.0)),
            sign * round(velocity / VELOCITY_UNIT),
            self._shown(encoder),
            sign * round(motor.trajectory_velocity / VELOCITY_UNIT),
            self._shown(motor.trajectory),
            round(volt * 10.0),
            round(celsius),
        )
