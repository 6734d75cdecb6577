"""The control table of the XL430-W250 as data: what stands where in a servo, in which unit.

The XL430 measures its load, not its current. Source: ROBOTIS e-manual, XL430-W250, firmware 46.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import NamedTuple

MODEL_NUMBER = 1060
TICKS_PER_TURN = 4096
CENTRE_TICK = 2048


class Register(NamedTuple):
    """One entry of the control table.

    Attributes:
        name: the e-manual's, in lower case with underscores.
        address: of its first byte.
        size: bytes, least significant first.
        signed: whether it is a two's complement.
        access: "r" or "rw".
        eeprom: kept without power, and locked while torque is on.
        unit_scale: value in ``unit`` is the number times this.
        unit: "" for numbers that name something.
        minimum: smallest number a write may hold.
        maximum: largest number a write may hold.
        initial: number after a factory reset (EEPROM) or a boot (RAM).
    """

    name: str
    address: int
    size: int
    signed: bool
    access: str
    eeprom: bool
    unit_scale: float
    unit: str
    minimum: int
    maximum: int
    initial: int

    @property
    def end(self) -> int:
        """Address behind its last byte."""
        return self.address + self.size

    def encode(self, value: int) -> bytes:
        """The bytes that a write of this number holds.

        Raises:
            OverflowError: if the number does not fit into the register.
        """
        return value.to_bytes(self.size, "little", signed=value < 0)

    def decode(self, data: bytes) -> int:
        """The number in ``size`` bytes."""
        return int.from_bytes(data, "little", signed=self.signed)


class OperatingMode(IntEnum):
    """How a servo understands its goals (register ``operating_mode``)."""

    VELOCITY = 1
    POSITION = 3
    EXTENDED_POSITION = 4
    PWM = 16


class HardwareError(IntFlag):
    """Bits of ``hardware_error_status`` and of the mask ``shutdown``."""

    INPUT_VOLTAGE = 1
    OVERHEATING = 4
    ENCODER = 8
    ELECTRICAL_SHOCK = 16
    OVERLOAD = 32


BAUD_RATES = (9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
"""Bits per second by the number in the register ``baud_rate``."""

WATCHDOG_TRIPPED = -1
"""What ``bus_watchdog`` reads after it has stopped the servo; goals are refused until it is 0."""
WATCHDOG_UNIT_MS = 20
RETURN_DELAY_UNIT_US = 2

_WORD, _LONG = 0xFFFF, 0x7FFF_FFFF
_RPM, _PULSE = (0.229, "rev/min"), (1.0, "tick")
_PERCENT, _VOLT, _NAME = (0.113, "%"), (0.1, "V"), (1.0, "")


def _register(
    address: int,
    size: int,
    name: str,
    access: str,
    unit: tuple[float, str],
    limits: tuple[int, int],
    initial: int,
    signed: bool = False,
) -> Register:
    eeprom = address < 64
    return Register(name, address, size, signed, access, eeprom, *unit, *limits, initial)


def _indirect() -> tuple[Register, ...]:
    """56 places whose address can be chosen and the 56 bytes seen through them, in two halves."""
    registers = []
    for first, addresses, data in ((1, 168, 224), (29, 578, 634)):
        for offset in range(28):
            number = first + offset
            name, target = f"indirect_address_{number}", data + offset
            place = addresses + 2 * offset
            registers.append(_register(place, 2, name, "rw", _NAME, (64, 661), target))
            name = f"indirect_data_{number}"
            registers.append(_register(target, 1, name, "rw", _NAME, (0, 255), 0))
    return tuple(registers)


_EEPROM = (
    _register(0, 2, "model_number", "r", _NAME, (0, _WORD), MODEL_NUMBER),
    _register(2, 4, "model_information", "r", _NAME, (0, _LONG), 0),
    _register(6, 1, "firmware_version", "r", _NAME, (0, 255), 46),
    _register(7, 1, "id", "rw", _NAME, (0, 252), 1),
    _register(8, 1, "baud_rate", "rw", _NAME, (0, 7), 1),
    _register(9, 1, "return_delay_time", "rw", (2.0, "us"), (0, 254), 250),
    _register(10, 1, "drive_mode", "rw", _NAME, (0, 13), 0),
    _register(11, 1, "operating_mode", "rw", _NAME, (0, 16), OperatingMode.POSITION),
    _register(12, 1, "secondary_id", "rw", _NAME, (0, 255), 255),
    _register(13, 1, "protocol_type", "rw", _NAME, (1, 2), 2),
    _register(20, 4, "homing_offset", "rw", _PULSE, (-1_044_479, 1_044_479), 0, signed=True),
    _register(24, 4, "moving_threshold", "rw", _RPM, (0, 1023), 10),
    _register(31, 1, "temperature_limit", "rw", (1.0, "°C"), (0, 100), 72),
    _register(32, 2, "max_voltage_limit", "rw", _VOLT, (60, 140), 140),
    _register(34, 2, "min_voltage_limit", "rw", _VOLT, (60, 140), 60),
    _register(36, 2, "pwm_limit", "rw", _PERCENT, (0, 885), 885),
    _register(44, 4, "velocity_limit", "rw", _RPM, (0, 1023), 265),
    _register(48, 4, "max_position_limit", "rw", _PULSE, (0, 4095), 4095),
    _register(52, 4, "min_position_limit", "rw", _PULSE, (0, 4095), 0),
    _register(60, 1, "startup_configuration", "rw", _NAME, (0, 3), 0),
    _register(63, 1, "shutdown", "rw", _NAME, (0, 63), 52),
)

_RAM = (
    _register(64, 1, "torque_enable", "rw", _NAME, (0, 1), 0),
    _register(65, 1, "led", "rw", _NAME, (0, 1), 0),
    _register(68, 1, "status_return_level", "rw", _NAME, (0, 2), 2),
    _register(69, 1, "registered_instruction", "r", _NAME, (0, 1), 0),
    _register(70, 1, "hardware_error_status", "r", _NAME, (0, 63), 0),
    _register(76, 2, "velocity_i_gain", "rw", _NAME, (0, 16_383), 1000),
    _register(78, 2, "velocity_p_gain", "rw", _NAME, (0, 16_383), 100),
    _register(80, 2, "position_d_gain", "rw", _NAME, (0, 16_383), 4000),
    _register(82, 2, "position_i_gain", "rw", _NAME, (0, 16_383), 0),
    _register(84, 2, "position_p_gain", "rw", _NAME, (0, 16_383), 640),
    _register(88, 2, "feedforward_2nd_gain", "rw", _NAME, (0, 16_383), 0),
    _register(90, 2, "feedforward_1st_gain", "rw", _NAME, (0, 16_383), 0),
    _register(98, 1, "bus_watchdog", "rw", (20.0, "ms"), (0, 127), 0, signed=True),
    _register(100, 2, "goal_pwm", "rw", _PERCENT, (-885, 885), 885, signed=True),
    _register(104, 4, "goal_velocity", "rw", _RPM, (-1023, 1023), 0, signed=True),
    _register(108, 4, "profile_acceleration", "rw", (214.577, "rev/min²"), (0, 32_767), 0),
    _register(112, 4, "profile_velocity", "rw", _RPM, (0, 32_767), 0),
    _register(116, 4, "goal_position", "rw", _PULSE, (-1_048_575, 1_048_575), 0, signed=True),
    _register(120, 2, "realtime_tick", "r", (1.0, "ms"), (0, 32_767), 0),
    _register(122, 1, "moving", "r", _NAME, (0, 1), 0),
    _register(123, 1, "moving_status", "r", _NAME, (0, 255), 0),
    _register(124, 2, "present_pwm", "r", _PERCENT, (-885, 885), 0, signed=True),
    _register(126, 2, "present_load", "r", (0.1, "%"), (-1000, 1000), 0, signed=True),
    _register(128, 4, "present_velocity", "r", _RPM, (-1023, 1023), 0, signed=True),
    _register(132, 4, "present_position", "r", _PULSE, (-_LONG, _LONG), 0, signed=True),
    _register(136, 4, "velocity_trajectory", "r", _RPM, (-1023, 1023), 0, signed=True),
    _register(140, 4, "position_trajectory", "r", _PULSE, (-_LONG, _LONG), 0, signed=True),
    _register(144, 2, "present_input_voltage", "r", _VOLT, (0, _WORD), 120),
    _register(146, 1, "present_temperature", "r", (1.0, "°C"), (0, 255), 25),
    _register(147, 1, "backup_ready", "r", _NAME, (0, 1), 0),
)

TABLE: dict[str, Register] = {
    register.name: register
    for register in sorted((*_EEPROM, *_RAM, *_indirect()), key=lambda entry: entry.address)
}
"""Every register of the servo by its name, in the order of addresses."""

END = max(register.end for register in TABLE.values())
"""Address behind the last register."""

PRESENT = (TABLE["present_load"].address, TABLE["present_temperature"].end)
"""First address and the one behind the last of what a cycle reads: load, velocity, position,
both trajectories, input voltage and temperature; 21 bytes."""
