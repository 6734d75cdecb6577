"""What can go wrong on the servo bus, by name."""

from __future__ import annotations

from hardware.servos.control_table import HardwareError
from hardware.servos.protocol import StatusError
from robot.errors import KeyholeError


class BusError(KeyholeError):
    """Base class of what goes wrong between the host and the servos.

    Attributes:
        port: the serial port's path.
    """

    code = "servo_bus"

    def __init__(self, port: str, message: str) -> None:
        super().__init__(f"{port}: {message}")
        self.port = port


class PortMissing(BusError):
    """No port could be opened.

    Attributes:
        reason: the system's words, or what was looked for.
    """

    code = "servo_port_missing"

    def __init__(self, port: str, reason: str) -> None:
        super().__init__(
            port,
            f"cannot be opened ({reason}); plug the adapter in, join the group dialout, or set "
            "[servos] port; `keyhole doctor` tells more",
        )
        self.reason = reason


class PortLost(BusError):
    """The port went away while it was in use.

    Attributes:
        reason: the system's words.
    """

    code = "servo_port_lost"

    def __init__(self, port: str, reason: str) -> None:
        super().__init__(port, f"the port went away ({reason}); plug the adapter in again")
        self.reason = reason


class ServoSilent(BusError):
    """A servo did not answer.

    Attributes:
        servo: its id.
    """

    code = "servo_silent"

    def __init__(self, port: str, servo: int, waited_s: float) -> None:
        super().__init__(
            port,
            f"servo {servo} did not answer within {waited_s * 1e3:.0f} ms; check its cable, power, "
            "id and baud rate (`keyhole doctor`)",
        )
        self.servo, self.waited_s = servo, waited_s


class ServoRefused(BusError):
    """A servo refused an instruction.

    Attributes:
        servo: its id.
        error: why.
        what: the instruction in words.
    """

    code = "servo_refused"

    def __init__(self, port: str, servo: int, error: int, what: str) -> None:
        known = error in set(StatusError)
        reason = StatusError(error).name.lower().replace("_", " ") if known else f"error {error}"
        super().__init__(port, f"servo {servo} refused to {what}: {reason}")
        self.servo, self.error, self.what = servo, error, what


class ServoFault(BusError):
    """A servo tells of a fault of its own (register 70).

    Attributes:
        servo: its id.
        status: its bits.
    """

    code = "servo_fault"

    def __init__(self, port: str, servo: int, status: HardwareError) -> None:
        super().__init__(port, fault_message(servo, status))
        self.servo, self.status = servo, status


_WHAT_TO_DO = {
    HardwareError.INPUT_VOLTAGE: ("input voltage outside its limits", "check the power supply"),
    HardwareError.OVERHEATING: ("too hot", "let it cool down"),
    HardwareError.ENCODER: ("its encoder failed", "replace it"),
    HardwareError.ELECTRICAL_SHOCK: ("electrical shock", "check cables and supply"),
    HardwareError.OVERLOAD: ("overload, torque is off", "free the instrument"),
}


def fault_message(servo: int, status: HardwareError) -> str:
    """A servo's fault in one line: what, and what to do."""
    known = [_WHAT_TO_DO[bit] for bit in HardwareError if bit in status]
    what = ", ".join(text for text, _ in known) or "unknown fault"
    do = ", ".join(text for _, text in known) or "read register 70"
    return f"servo {servo}: {what}; {do}, then reboot the servos and home"
