"""The memory of one servo: what can be read, what a write may change, and why it is refused."""

from __future__ import annotations

from collections.abc import Sequence

from hardware.servos.control_table import END, TABLE, WATCHDOG_TRIPPED, OperatingMode, Register
from hardware.servos.protocol import StatusError

_AT = {register.address: register for register in TABLE.values()}
_DEFINED = {address for entry in TABLE.values() for address in range(entry.address, entry.end)}
_PLACES = {entry.name: (entry.address, entry.end, entry.signed) for entry in TABLE.values()}
_TORQUE, _WATCHDOG = TABLE["torque_enable"].address, TABLE["bus_watchdog"].address
_TRIPPED = WATCHDOG_TRIPPED & 0xFF
_RAM = [register for register in TABLE.values() if not register.eeprom]
_INDIRECT = {
    TABLE[f"indirect_data_{number}"].address: TABLE[f"indirect_address_{number}"].address
    for number in range(1, 57)
}
"""Address of the register that says where an indirect byte stands, by the byte's address."""
_GOALS = {"goal_pwm", "goal_velocity", "goal_position"}
_MODES = {mode.value for mode in OperatingMode}


class Registers:
    """Values of every register of :data:`hardware.servos.control_table.TABLE`.

    ``registers["goal_position"]`` is the number in it.
    """

    def __init__(self) -> None:
        self.memory = bytearray(END)
        for register in TABLE.values():
            self[register.name] = register.initial

    def __getitem__(self, name: str) -> int:
        begin, end, signed = _PLACES[name]
        return int.from_bytes(self.memory[begin:end], "little", signed=signed)

    def __setitem__(self, name: str, value: int) -> None:
        register = TABLE[name]
        self.memory[register.address : register.end] = register.encode(value)

    def boot(self) -> None:
        """Put what is not kept without power back to its initial values."""
        for register in _RAM:
            self[register.name] = register.initial

    def read(self, address: int, size: int) -> bytes | None:
        """The bytes there, seen through indirect addresses; None outside of the table."""
        if size == 0 or address + size > END:
            return None
        places = self._places(address, size)
        if isinstance(places, range):
            return bytes(self.memory[address : address + size])
        return bytes(self.memory[place] for place in places)

    def _places(self, address: int, size: int) -> Sequence[int]:
        """Where the bytes really stand."""
        places = range(address, address + size)
        if address + size <= 224 or not any(place in _INDIRECT for place in places):
            return places
        return [self._place(place) for place in places]

    def _place(self, address: int) -> int:
        pointer = _INDIRECT.get(address)
        if pointer is None:
            return address
        return self.memory[pointer] | self.memory[pointer + 1] << 8

    def check(self, address: int, data: bytes) -> tuple[StatusError, list[tuple[Register, int]]]:
        """Decide on a write without doing it.

        Returns:
            The refusal, or ``NONE`` and the numbers that the registers would hold.
        """
        if not data or address + len(data) > END:
            return StatusError.ACCESS, []
        places = self._places(address, len(data))
        values: list[tuple[Register, int]] = []
        done = 0
        while done < len(data):
            register = _AT.get(places[done])
            if register is None:
                inside = places[done] in _DEFINED
                return (StatusError.DATA_LENGTH if inside else StatusError.ACCESS), []
            if register.access == "r":
                return StatusError.ACCESS, []
            taken = places[done : done + register.size]
            if list(taken) != list(range(register.address, register.end)):
                return StatusError.DATA_LENGTH, []
            value = register.decode(data[done : done + register.size])
            error = self._refusal(register, value)
            if error:
                return error, []
            values.append((register, value))
            done += register.size
        return StatusError.NONE, values

    def _refusal(self, register: Register, value: int) -> StatusError:
        name = register.name
        if register.eeprom and self.memory[_TORQUE]:
            return StatusError.ACCESS
        if not register.minimum <= value <= register.maximum:
            return StatusError.DATA_RANGE
        if name == "operating_mode" and value not in _MODES:
            return StatusError.DATA_RANGE
        if self.memory[_WATCHDOG] == _TRIPPED and (
            name in _GOALS or (name == "bus_watchdog" and value != 0)
        ):
            return StatusError.DATA_RANGE
        if name == "goal_position":
            in_one_turn = self["operating_mode"] == OperatingMode.POSITION
            low, high = self["min_position_limit"], self["max_position_limit"]
            limited = in_one_turn and not low <= value <= high
        elif name in {"goal_velocity", "goal_pwm"}:
            limited = (
                abs(value) > self["velocity_limit" if name == "goal_velocity" else "pwm_limit"]
            )
        else:
            limited = False
        return StatusError.DATA_LIMIT if limited else StatusError.NONE
