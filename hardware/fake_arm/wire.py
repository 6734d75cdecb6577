"""The frames on an xArm controller's command port.

A request is transaction (2 bytes), protocol (2), length of what follows (2), register (1) and data;
the answer repeats the head, with a status byte before its data. Integers are big-endian.
"""

from __future__ import annotations

import struct
from enum import IntEnum, IntFlag
from typing import NamedTuple

_HEAD = struct.Struct(">HHHB")
_LENGTH_END = 6
_LONGEST = 1024
PROTOCOLS = (2, 3)
"""The vendor's own, without and with a sign of life expected; others get no answer."""


class Register(IntEnum):
    """What can be asked for."""

    GET_VERSION = 1
    GET_SERIAL_NUMBER = 2
    SYSTEM_CONTROL = 10
    MOTION_ENABLE = 11
    SET_STATE = 12
    GET_STATE = 13
    GET_COMMAND_COUNT = 14
    GET_ERROR = 15
    CLEAN_ERROR = 16
    CLEAN_WARNING = 17
    SET_MODE = 19
    MOVE_SERVO_JOINTS = 29
    SET_PAYLOAD = 36
    SET_COLLISION_SENSITIVITY = 37
    SET_TEACHING_SENSITIVITY = 38
    GET_POSE = 41
    GET_JOINTS = 42


class Status(IntFlag):
    """Bits of the byte before an answer's data."""

    FINE = 0
    INVALID = 0x08
    NOT_READY = 0x10
    WARNING = 0x20
    ERROR = 0x40


class Request(NamedTuple):
    """One request: head and data."""

    transaction: int
    protocol: int
    register: int
    data: bytes


class RequestReader:
    """Cuts a stream of bytes into requests."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, received: bytes) -> list[Request]:
        """Take bytes; give the requests that are complete now.

        A stream that cannot be one of requests is forgotten up to here.
        """
        self._rest += received
        found = []
        while len(self._rest) >= _HEAD.size:
            transaction, protocol, length, register = _HEAD.unpack_from(self._rest)
            if not 1 <= length <= _LONGEST:
                self._rest = b""
                break
            end = _LENGTH_END + length
            if len(self._rest) < end:
                break
            found.append(Request(transaction, protocol, register, self._rest[_HEAD.size : end]))
            self._rest = self._rest[end:]
        return found


def answer(request: Request, status: int, data: bytes) -> bytes:
    """The bytes of the answer to ``request``."""
    head = _HEAD.pack(request.transaction, request.protocol, 2 + len(data), request.register)
    return head + bytes((status,)) + data
