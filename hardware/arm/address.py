"""Where an xArm's controller listens."""

from __future__ import annotations

import ipaddress
from typing import NamedTuple

from robot.errors import KeyholeError

CONTROL_PORT = 502
"""For commands and their answers; a stand-in that nobody lets listen there may have another one."""

NORMAL_PORT, RICH_PORT, REAL_PORT = 30001, 30002, 30003
"""For reports: with error codes, with everything (5 Hz both), with joints and state only (100 Hz).
They are fixed: the vendor's library knows the form of a report by its port."""


class InvalidArmAddress(KeyholeError):
    """The arm's address is no IPv4 address, or its port is none.

    Attributes:
        address: as it was given.
    """

    code = "invalid_arm_address"

    def __init__(self, address: str) -> None:
        super().__init__(
            f"the arm's address {address!r} is refused: give the IPv4 address of its controller "
            '([hardware] arm_address = "192.168.1.203"), or ADDRESS:PORT for a stand-in '
            "(127.0.0.1:5020)"
        )
        self.address = address


class ArmAddress(NamedTuple):
    """Host and command port of a controller.

    Attributes:
        host: IPv4 address.
        control: port for commands.
    """

    host: str
    control: int = CONTROL_PORT

    def __str__(self) -> str:
        return self.host if self.control == CONTROL_PORT else f"{self.host}:{self.control}"


def arm_address(text: str) -> ArmAddress:
    """Read ``HOST`` or ``HOST:PORT``.

    Raises:
        InvalidArmAddress: if it is neither.
    """
    host, separator, port = text.strip().partition(":")
    try:
        host = str(ipaddress.IPv4Address("127.0.0.1" if host == "localhost" else host))
        control = int(port) if separator else CONTROL_PORT
    except ValueError as error:
        raise InvalidArmAddress(text) from error
    if not 0 < control < 65536:
        raise InvalidArmAddress(text)
    return ArmAddress(host, control)
