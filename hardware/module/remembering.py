"""The zero outlives the host: it is kept in the servos' own memory, which power and reboot clear.

A control process that is started again finds servos that still hold under torque; without the zero
it would have to home a segment that is bent. Four bytes of the indirect data, which nothing else
uses here, hold a mark, a check byte and the tick; torque that goes takes the mark along.
"""

from __future__ import annotations

from collections.abc import Sequence

from hardware.servos.bus import ServoBus
from hardware.servos.control_table import TABLE
from robot.configuration import Servos

_ADDRESS = TABLE["indirect_data_1"].address
_MARK, _CHECK = 0x4B, 0xA5
_SIZE = 4


def _bytes(servo: int, direction: int, tick: int) -> bytes:
    low, high = tick & 0xFF, tick >> 8
    check = low ^ high ^ servo ^ (direction & 0xFF) ^ _CHECK
    return bytes((_MARK, check, low, high))


def remember_zero(bus: ServoBus, settings: Servos, zero: Sequence[int]) -> None:
    """Leave the zero with the servos. Errors as :meth:`ServoBus.write`."""
    for servo, direction, tick in zip(settings.ids, settings.directions, zero, strict=True):
        bus.write_bytes(servo, _ADDRESS, _bytes(servo, direction, tick))


def forget_zero(bus: ServoBus, settings: Servos) -> None:
    """Make all servos forget it, also those that do not answer.

    Raises:
        PortLost: if the port is gone.
    """
    registers = [f"indirect_data_{number}" for number in range(1, _SIZE + 1)]
    for register in registers:
        bus.sync_write(register, [(servo, 0) for servo in settings.ids])


def remembered_zero(bus: ServoBus, settings: Servos) -> list[int] | None:
    """The zero that the servos were left with; None if any of them has forgotten it.

    Errors as :meth:`ServoBus.read`.
    """
    zero = []
    for servo, direction in zip(settings.ids, settings.directions, strict=True):
        data = bus.read_bytes(servo, _ADDRESS, _SIZE).data
        tick = data[2] | data[3] << 8
        if data != _bytes(servo, direction, tick):
            return None
        zero.append(tick)
    return zero
