"""A serial port that is none: the servos' end of a pseudo-terminal, under a name that stays.

It can be unplugged, which the host sees as a port that hangs up, and plugged in again under the
same or another name. What the host sets as its speed is read back from the terminal.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import struct
import sys
import termios
import tty
from pathlib import Path

from robot.errors import KeyholeError

_TCGETS2, _SIZE, _SPEED_OFFSET = 0x802C542A, 44, 40
_SPEEDS = {
    number: int(name[1:])
    for name, number in vars(termios).items()
    if name.startswith("B") and name[1:].isdigit()
}
_LARGEST_READ = 4096


class LinkTaken(KeyholeError):
    """The name for the port is used by something that is not a link.

    Attributes:
        path: the name.
    """

    code = "link_taken"

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} exists and is no link; choose another --link")
        self.path = path


class PseudoTerminal:
    """The servos' end of the port.

    Args:
        link: name under which the host finds its end.

    Attributes:
        link: the present name; None while it is unplugged.
        master: descriptor to wait on; -1 while it is unplugged.
    """

    def __init__(self, link: Path) -> None:
        self.link: Path | None = None
        self.master = -1
        # Kept open, so that a host that closes its end does not look like one that is gone.
        self._slave = -1
        self.plug(link)

    def plug(self, link: Path) -> None:
        """Appear under this name.

        Raises:
            LinkTaken: there is something else of this name.
        """
        self.unplug()
        if link.exists() and not link.is_symlink():
            raise LinkTaken(link)
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)
        # A link that appears whole or not at all: hosts look for it all the time.
        new = link.with_name(f".{link.name}.new")
        with contextlib.suppress(FileNotFoundError):
            new.unlink()
        new.symlink_to(os.ttyname(self._slave))
        new.replace(link)
        self.link = link

    def unplug(self) -> None:
        """Disappear; harmless when it is unplugged."""
        if self.link is not None and self.link.is_symlink():
            self.link.unlink()
        for descriptor in (self.master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self.master = self._slave = -1
        self.link = None

    def read(self) -> bytes:
        """What the host has written; nothing when there is nothing."""
        try:
            return os.read(self.master, _LARGEST_READ)
        except OSError:
            return b""

    def write(self, data: bytes) -> None:
        """Send to the host; what nobody takes out is lost, as on a wire."""
        with contextlib.suppress(OSError):
            os.write(self.master, data)

    def baud_rate(self) -> int:
        """Bits per second that the host has set; 0 where it cannot be told."""
        if sys.platform == "linux":
            settings = bytearray(_SIZE)
            with contextlib.suppress(OSError):
                fcntl.ioctl(self._slave, _TCGETS2, settings)
                return int(struct.unpack_from("I", settings, _SPEED_OFFSET)[0])
        return _SPEEDS.get(termios.tcgetattr(self._slave)[5], 0)
