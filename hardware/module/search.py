"""Finding the bus: where it is configured, and after it was lost, wherever it comes back."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence

from hardware.servos.bus import ServoBus
from hardware.servos.errors import BusError, PortMissing
from hardware.servos.port import SerialPort, candidates
from robot.configuration import Servos

_AUTO = "auto"


class BusSearch:
    """Opens the port behind which the servos answer.

    After a loss that is the same path, the configured pattern, or any port that was not there while
    the bus was connected; a port that was there belongs to something else and is left alone.
    """

    def __init__(self, settings: Servos) -> None:
        """Search as configured."""
        self._settings = settings
        self._foreign: set[str] | None = None
        self._last = ""

    def open(self) -> ServoBus:
        """Open the first port at which all servos answer.

        Raises:
            PortMissing: if there is no port at all.
            BusError: what went wrong at the port that came nearest.
        """
        worst: BusError = PortMissing(self._settings.port, "no such port")
        for path in self._paths():
            try:
                bus = ServoBus(SerialPort(path, self._settings.baud_rate))
            except BusError as error:
                worst = error
                continue
            try:
                for servo in self._settings.ids:
                    bus.ping(servo)
            except BusError as error:
                bus.port.close()
                worst = error
                continue
            self._remember(path)
            return bus
        raise worst

    def ports(self) -> Iterator[SerialPort]:
        """Open one port after the other, whoever answers there; the caller closes each."""
        for path in self._paths():
            with contextlib.suppress(BusError):
                yield SerialPort(path, self._settings.baud_rate)

    def _paths(self) -> Sequence[str]:
        paths = candidates(self._settings.port)
        if self._foreign is not None:
            paths = [path for path in (self._last, *paths) if os.path.exists(path)]
            appeared = candidates(_AUTO)
            paths += [path for path in appeared if os.path.realpath(path) not in self._foreign]
        devices: dict[str, str] = {}
        for path in paths:
            devices.setdefault(os.path.realpath(path), path)
        return list(devices.values())

    def _remember(self, path: str) -> None:
        own = os.path.realpath(path)
        self._last = path
        self._foreign = {os.path.realpath(other) for other in candidates(_AUTO)} - {own}
        with contextlib.suppress(OSError):
            # The adapter's own name stays when the number of its device changes.
            for other in candidates(_AUTO):
                if os.path.realpath(other) == own:
                    self._last = other
