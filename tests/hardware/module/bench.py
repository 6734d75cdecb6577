"""The driver in front of the servo simulator, on a pseudo-terminal."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from hardware.devices import DEVICES
from hardware.fake_servos.client import FakeServos, FakeServosProcess
from hardware.module.module import InstrumentModule, ModuleReading
from robot.configuration import Configuration
from robot.records import Readiness
from server.configuration_file import load

_PATIENCE_S = 30.0
_TICK_S = 0.002
BUS_PATIENCE_S = 0.15
"""Longer than a busy machine lets the simulator wait."""
IDS = (101, 102, 103, 104)


def settings(port: Path, **changes: Any) -> Configuration:
    """The usual configuration with a slow and patient bus: nothing here is about speed."""
    configuration = load()
    patient = {
        "port": str(port),
        "rate_hz": 100.0,
        "watchdog_ms": 2000,
        "homing_speed_deg_s": 90.0,
        "profile_velocity_deg_s": 360.0,
    }
    servos = configuration.servos.model_copy(update=patient | changes)
    return configuration.model_copy(update={"servos": servos})


class Bench:
    """A module, the simulator that it talks to, and what a control loop would do.

    Attributes:
        module: under test.
        servos: the simulator's control channel.
    """

    def __init__(self, module: InstrumentModule, servos: FakeServos) -> None:
        self.module, self.servos = module, servos
        self.angles, self.loads = np.zeros(4), np.zeros(4)
        self.command = np.zeros(4)

    def read(self) -> ModuleReading:
        return self.module.read(self.angles, self.loads)

    def devices(self) -> Any:
        devices = np.zeros(1, DEVICES)
        self.module.fill_devices(devices)
        return devices[0]["bus"]

    @property
    def message(self) -> str:
        return bytes(self.devices()["message"]).decode()

    def until(
        self,
        condition: Callable[[ModuleReading], bool],
        motion: Callable[[float], np.ndarray] | None = None,
    ) -> None:
        """Command what stands, or a motion over the seconds since its begin, until it is so."""
        begin = time.monotonic()
        while not condition(self.read()):
            passed = time.monotonic() - begin
            assert passed < _PATIENCE_S, (self.read(), self.message)
            if motion is not None:
                self.command[:] = motion(passed)
            self.module.write(self.command, motion is not None)
            time.sleep(_TICK_S)

    def moving_until(self, condition: Callable[[ModuleReading], bool]) -> None:
        """Bend to and fro until it is so."""
        start = self.command.copy()
        away = np.array((-0.3, 0.0, 0.3, 0.0))
        self.until(condition, lambda seconds: start + away * np.sin(2.0 * seconds))

    def drive_to(self, angles: tuple[float, ...]) -> None:
        """Command a straight motion until the servos are there, but for what their load leaves."""
        start, target = self.command.copy(), np.array(angles)
        self.until(
            lambda _: bool(np.all(np.abs(self.angles - target) < 0.06)),
            lambda seconds: start + (target - start) * min(1.0, seconds),
        )

    def insist(self, angles: np.ndarray, seconds: float = 0.15) -> None:
        """Command a motion to ``angles`` at once."""
        end = time.monotonic() + seconds
        self.until(lambda _: time.monotonic() > end, lambda _: angles)

    def rest(self, seconds: float = 0.05) -> None:
        """Command what stands, not moving."""
        end = time.monotonic() + seconds
        self.until(lambda _: time.monotonic() > end)

    def ready(self) -> None:
        """Clear all faults, home if need be, and be as a control loop that has just enabled."""
        self.servos.clear()
        self.until(lambda reading: reading.readiness != Readiness.NOT_CONNECTED)
        if self.devices()["servos"]["hardware_error"].any():
            self.module.reboot()
        self.until(lambda reading: reading.event == 0)
        if self.read().readiness != Readiness.READY:
            message = self.home()
            assert self.read().readiness == Readiness.READY, message
        self.read()
        self.command[:] = self.angles
        self.rest()

    def home(self) -> str:
        """Home, again if a busy machine let answers get lost; what the module says of it."""
        for _ in range(4):
            self.module.home()
            self.until(lambda reading: reading.readiness == Readiness.BUSY)
            self.until(lambda reading: reading.readiness != Readiness.BUSY)
            self.until(lambda reading: reading.event == 0)
            message = self.message
            if "silent" not in message:
                break
        return message

    def goals(self) -> list[int]:
        """What the simulated servos are told."""
        return [servo["goal"] for servo in self.servos.state()["servos"]]

    def ticks(self) -> np.ndarray:
        """Where the simulated servos are."""
        return np.array([servo["ticks"] for servo in self.servos.state()["servos"]])


@contextmanager
def bench(*arguments: str, **changes: Any) -> Iterator[Bench]:
    """A simulator started with ``arguments`` and a module configured with ``changes``."""
    with TemporaryDirectory() as folder:
        link = Path(folder) / "ttyFAKE0"
        # Little slack: homing is not what most tests are about.
        slack = ("--slack-mm", "0.2,0.4,0.3,0.1")
        with FakeServosProcess(link, *slack, *arguments) as process:
            pattern = Path(folder) / "ttyFAKE*[0-9]"
            module = InstrumentModule(settings(pattern, **changes), BUS_PATIENCE_S)
            try:
                yield Bench(module, process.servos)
            finally:
                module.close()
