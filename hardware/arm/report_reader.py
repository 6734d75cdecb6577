"""Measured joints: a thread that reads the controller's fast report and stamps what comes.

The vendor's library reads reports too, but looks a thousand times a second whether one is there,
and does not tell when it came. Waiting in the socket costs nothing.
"""

from __future__ import annotations

import contextlib
import math
import os
import socket
import struct
import threading
import time

import numpy as np

from hardware.arm.address import REAL_PORT, ArmAddress
from hardware.arm.errors import ArmUnreachable
from hardware.arm.reports import LONGEST, SHORTEST

CONNECT_S, SILENT_S = 1.0, 1.0
PRIORITY = 55
"""Of the arm's threads, below the control loop's, where the system permits real time."""

_LENGTH = struct.Struct(">I")
_STATE_AT, _Q_AT = _LENGTH.size, _LENGTH.size + 3
_JOINTS = struct.Struct("<7f")
_SLOTS = 4


def ask_for_real_time() -> None:
    """Let the calling thread, and those that it starts, come before ordinary ones if permitted."""
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


class ReportReader:
    """The newest report, and when it came.

    Attributes:
        connected: whether reports can come.
        received: how many have come.
        refused: how many had joints that are no numbers.
        state: the controller's state in the newest one.
        mode: its mode.
    """

    def __init__(self, address: ArmAddress, realtime: bool) -> None:
        """Connect to nothing yet.

        Args:
            address: of the controller.
            realtime: whether its thread asks for real-time scheduling.
        """
        self._address, self._realtime = address, realtime
        self._q = np.zeros((_SLOTS, 7))
        self._stamps = [0] * _SLOTS
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self.connected = False
        self.received = self.refused = 0
        self.state = self.mode = 0

    def open(self) -> None:
        """Connect, and wait until a report has come.

        Raises:
            ArmUnreachable: if none comes within a second.
        """
        where = str(self._address)
        try:
            found = socket.create_connection((self._address.host, REAL_PORT), CONNECT_S)
        except OSError as error:
            reason = error.strerror or "it does not answer"
            raise ArmUnreachable(where, f"no arm's controller there ({reason})") from error
        found.settimeout(SILENT_S)
        self._socket = found
        before, first = self.received, threading.Event()
        self.connected = True
        self._thread = threading.Thread(
            target=self._run, args=(found, first), name="arm-reports", daemon=True
        )
        self._thread.start()
        first.wait(SILENT_S)
        if self.received == before:
            self.close()
            raise ArmUnreachable(where, "the controller sends no reports")

    def close(self) -> None:
        """Disconnect; what was measured stays."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
            if self._thread is not None:
                self._thread.join(2.0 * SILENT_S)
            self._socket.close()
        self._socket = self._thread = None

    def newest(self, out_q: np.ndarray) -> int:
        """Fill ``out_q`` (7,) with the newest joints, rad.

        Returns:
            When they came, by the host's monotonic clock in ns; 0 if none ever came, with ``out_q``
            left alone.
        """
        while True:
            count = self.received
            if count == 0:
                return 0
            out_q[:] = self._q[count % _SLOTS]
            stamp = self._stamps[count % _SLOTS]
            if self.received - count < _SLOTS - 1:
                return stamp

    def age_ns(self) -> int:
        """How long ago the newest report came; since the host's start if none ever did."""
        return time.monotonic_ns() - self._stamps[self.received % _SLOTS]

    def _run(self, connection: socket.socket, first: threading.Event) -> None:
        if self._realtime:
            ask_for_real_time()
        buffer = bytearray(LONGEST)
        with contextlib.suppress(OSError, EOFError):
            while True:
                self._take(connection, buffer)
                first.set()
        self.connected = False

    def _take(self, connection: socket.socket, buffer: bytearray) -> None:
        """One report; EOFError where the stream ends or is none of reports."""
        _fill(connection, memoryview(buffer)[: _LENGTH.size])
        (length,) = _LENGTH.unpack_from(buffer)
        if not SHORTEST <= length <= LONGEST:
            raise EOFError
        _fill(connection, memoryview(buffer)[_LENGTH.size : length])
        stamp = time.monotonic_ns()
        q = _JOINTS.unpack_from(buffer, _Q_AT)
        if not math.isfinite(sum(q)):
            self.refused += 1
            return
        place = (self.received + 1) % _SLOTS
        self._q[place], self._stamps[place] = q, stamp
        self.state, self.mode = buffer[_STATE_AT] & 0x0F, buffer[_STATE_AT] >> 4
        self.received += 1


def _fill(connection: socket.socket, view: memoryview) -> None:
    while view:
        count = connection.recv_into(view)
        if count == 0:
            raise EOFError
        view = view[count:]
