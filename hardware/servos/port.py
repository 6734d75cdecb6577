"""A serial port as the bus needs it: opened by pyserial, then bytes with deadlines, asleep between.

USB adapters gather bytes for up to 16 ms before they hand them on; where the port can, it is told
not to. A pseudo-terminal has no such mode and needs none.
"""

from __future__ import annotations

import fcntl
import glob
import os
import select
import struct
import sys
import termios
import time
from pathlib import Path

import serial

from hardware.servos.errors import PortLost, PortMissing

BITS_PER_BYTE = 10
"""Start bit, eight data bits, stop bit."""

_TIOCGSERIAL, _TIOCSSERIAL, _ASYNC_LOW_LATENCY = 0x541E, 0x541F, 0x2000
_SERIAL_STRUCT, _FLAGS_OFFSET = 72, 16
_DEFAULT_LATENCY_S = 0.016
_BY_ID = "/dev/serial/by-id/*"
_AUTO = (_BY_ID, "/dev/ttyUSB*", "/dev/ttyACM*", "/dev/tty.usbserial*", "/dev/cu.usbserial*")


def candidates(wanted: str) -> list[str]:
    """Paths of the ports that may hold the bus, the most stable names first, each device once.

    Args:
        wanted: "auto", a path, or a pattern such as ``/dev/ttyUSB*``. Beside a path its other
            stable names are tried, so that an adapter is found again under another one.
    """
    if wanted == "auto":
        found = [path for pattern in _AUTO for path in sorted(glob.glob(pattern))]
    elif glob.has_magic(wanted):
        found = sorted(glob.glob(wanted))
    else:
        found = [wanted] if Path(wanted).exists() else []
    devices: dict[str, str] = {}
    for path in found:
        devices.setdefault(os.path.realpath(path), path)
    return list(devices.values())


def latency_timer_ms(path: str) -> int | None:
    """How long a USB adapter gathers bytes before it hands them on; None where nobody can tell."""
    timer = Path("/sys/bus/usb-serial/devices") / Path(os.path.realpath(path)).name
    try:
        return int((timer / "latency_timer").read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


class SerialPort:
    """An open serial port, ours alone.

    Attributes:
        path: as it was opened.
        baud_rate: bits per second.
        low_latency: whether the port said yes to the low-latency mode.
        latency_s: how long bytes may wait in the adapter.
        fd: file descriptor.
    """

    def __init__(self, path: str, baud_rate: int) -> None:
        """Open and configure ``path``.

        Raises:
            PortMissing: if it does not exist, is used by another program, or may not be opened.
        """
        self.path, self.baud_rate = path, baud_rate
        try:
            self._serial = serial.Serial(
                path, baud_rate, timeout=0, write_timeout=0, exclusive=True
            )
        except (OSError, ValueError, termios.error) as error:
            raise PortMissing(path, str(error)) from error
        self.fd = int(self._serial.fileno())
        self.low_latency = _set_low_latency(self.fd)
        timer = latency_timer_ms(path)
        # The mode makes FTDI's driver set the timer to 1 ms.
        adapter = _DEFAULT_LATENCY_S if timer is None else timer * 1e-3
        is_terminal = os.path.realpath(path).startswith("/dev/pts/")
        self.latency_s = 0.001 if self.low_latency or is_terminal else adapter
        self.byte_s = BITS_PER_BYTE / baud_rate
        self._expected = 0
        self._scratch = memoryview(bytearray(4096))
        self._poll = select.poll()
        self._poll.register(self.fd, select.POLLIN)
        self.expect(1)

    def expect(self, count: int) -> None:
        """Wake up only when so many bytes (1 to 255) are there, or the time is over."""
        if count == self._expected:
            return
        try:
            attributes = termios.tcgetattr(self.fd)
            attributes[6][termios.VMIN] = count
            attributes[6][termios.VTIME] = 0
            termios.tcsetattr(self.fd, termios.TCSANOW, attributes)
        except termios.error as error:
            raise PortLost(self.path, str(error)) from error
        self._expected = count

    def write(self, data: bytes | bytearray) -> None:
        """Send ``data`` at once.

        Raises:
            PortLost: if the port is gone, or takes no more.
        """
        try:
            sent = os.write(self.fd, data)
        except OSError as error:
            raise PortLost(self.path, str(error.strerror)) from error
        if sent != len(data):
            raise PortLost(self.path, f"it took {sent} of {len(data)} bytes")

    def wait(self, deadline_ns: int) -> bool:
        """Sleep until bytes are there (True) or the monotonic time is over (False).

        Raises:
            PortLost: if the port hung up.
        """
        left = deadline_ns - time.monotonic_ns()
        events = self._poll.poll(max(left, 0) / 1e6)
        if not events:
            return False
        if events[0][1] & (select.POLLHUP | select.POLLERR | select.POLLNVAL):
            raise PortLost(self.path, "hung up")
        return True

    def read_into(self, buffer: memoryview) -> int:
        """Take what is there, without waiting; how many bytes.

        Raises:
            PortLost: if the port is gone.
        """
        try:
            count = os.readv(self.fd, (buffer,))
        except BlockingIOError:
            return 0
        except OSError as error:
            raise PortLost(self.path, str(error.strerror)) from error
        if count == 0:
            raise PortLost(self.path, "end of file")
        return count

    def discard(self) -> int:
        """Throw away what is there; how many bytes that was."""
        total = 0
        while count := self.read_into(self._scratch):
            total += count
        return total

    def close(self) -> None:
        """Give the port back."""
        self._serial.close()


def _set_low_latency(fd: int) -> bool:
    """Ask the driver to hand on every byte at once; whether it agreed."""
    if sys.platform != "linux":
        return False
    settings = bytearray(_SERIAL_STRUCT)
    try:
        fcntl.ioctl(fd, _TIOCGSERIAL, settings)
        flags = struct.unpack_from("i", settings, _FLAGS_OFFSET)[0]
        struct.pack_into("i", settings, _FLAGS_OFFSET, flags | _ASYNC_LOW_LATENCY)
        fcntl.ioctl(fd, _TIOCSSERIAL, settings)
    except OSError:
        return False
    return True
