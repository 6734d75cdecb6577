"""The thread that talks to the servos: searches, prepares, then cycles until it is told to end.

What it shares with the control loop are whole objects that are exchanged by assignment: the newest
command in, the newest :class:`Snapshot` out. Orders wait in a queue and are carried out between two
cycles. Nothing else is shared, and the control loop never waits for this thread.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from enum import Enum
from typing import NamedTuple

import numpy as np

from hardware.devices import DeviceState
from hardware.module.cycle_times import CycleTimes
from hardware.module.errors import ModuleError
from hardware.module.module_servos import PATIENCE_S, ModuleServos
from hardware.module.preparation import disarm_watchdogs, release_all
from hardware.module.scheduling import prefer_this_thread
from hardware.module.search import BusSearch
from hardware.servos.bus import Counters, ServoBus
from hardware.servos.errors import BusError, PortLost, ServoRefused, ServoSilent
from robot.configuration import Configuration
from robot.records import SERVOS, Readiness
from robot.safety import Event

_SEARCH_S = 0.2
_END_S = 3.0


class Order(Enum):
    """What the module can be told beside positions."""

    HOLD = "hold"
    RELEASE = "release"
    TAKE_HOLD = "take hold"
    HOME = "home"
    REBOOT = "reboot"


class Command(NamedTuple):
    """Servo angles to go to.

    Attributes:
        stamp_ns: when they were given.
        angles: four, rad.
        moving: whether they belong to a motion.
    """

    stamp_ns: int
    angles: tuple[float, ...]
    moving: bool


class Snapshot(NamedTuple):
    """What the servos said last.

    Attributes:
        stamp_ns: of the oldest of the four answers.
        angles: four, rad.
        loads: four, share of the largest load.
        valid: whether they are connected and all answer.
        event: a ``robot.safety.Event``; 0 without one.
        readiness: a ``robot.records.Readiness``.
    """

    stamp_ns: int
    angles: tuple[float, ...]
    loads: tuple[float, ...]
    valid: bool
    event: int
    readiness: int


class ModuleWorker:
    """Owns the bus in a thread of its own.

    Attributes:
        command: the newest one; replaced, never changed.
        snapshot: likewise.
        servos: the servos; only this thread may touch what is more than a number.
        times: figures of the cycle.
        counters: of the present connection.
        state: a ``hardware.devices.DeviceState``.
        port: path of the port; empty while searching.
        reconnects: connections after the first.
        realtime: whether the thread runs under SCHED_FIFO.
    """

    def __init__(
        self,
        configuration: Configuration,
        realtime: bool = True,
        patience_s: float = PATIENCE_S,
    ) -> None:
        """Start to search.

        Args:
            configuration: of the bus and the module.
            realtime: whether to ask for real-time scheduling.
            patience_s: how late an answer of the servos may be.
        """
        zeros = (0.0,) * SERVOS
        self.servos = ModuleServos(configuration, patience_s)
        self.times = CycleTimes()
        self.counters = Counters()
        self.command = Command(0, zeros, False)
        self.snapshot = Snapshot(0, zeros, zeros, False, 0, int(Readiness.NOT_CONNECTED))
        self.state = DeviceState.SEARCHING
        self.port, self.reconnects, self.realtime = "", 0, False
        self._settings = configuration.servos
        self._search = BusSearch(configuration.servos)
        self._wants_realtime = realtime
        self._period_ns = round(1e9 / configuration.servos.rate_hz)
        self._orders: deque[Order] = deque()
        self._closing = threading.Event()
        self._angles = np.zeros(SERVOS)
        self._connected_before = False
        self._thread = threading.Thread(target=self._run, name="servo bus", daemon=True)
        self._thread.start()

    def order(self, order: Order) -> None:
        """Have something done between two cycles; while not connected only RELEASE is tried."""
        self._orders.append(order)

    def close(self) -> None:
        """End: the servos hold, without watchdogs."""
        self._closing.set()
        self._thread.join(_END_S)

    def _run(self) -> None:
        self.realtime = self._wants_realtime and prefer_this_thread()
        while not self._closing.is_set():
            self.state = DeviceState.SEARCHING
            try:
                bus = self._search.open()
            except BusError as error:
                self._not_connected(str(error))
                self._release_unprepared()
                self._closing.wait(_SEARCH_S)
                continue
            try:
                self._serve(bus)
            except (BusError, ModuleError) as error:
                self._not_connected(str(error))
                if not isinstance(error, PortLost):
                    self._closing.wait(_SEARCH_S)
            except Exception as error:
                # The servos stop by themselves; their last measurement must not count any more.
                self._not_connected(f"the driver failed: {error!r}; start the console again")
                raise
            finally:
                bus.port.close()

    def _not_connected(self, message: str) -> None:
        self.servos.disconnect()
        self.servos.message = message
        self.state, self.port = DeviceState.SEARCHING, ""
        readiness = int(Readiness.NOT_CONNECTED)
        self.snapshot = self.snapshot._replace(
            valid=False, event=int(Event.BUS_LOST), readiness=readiness
        )

    def _release_unprepared(self) -> None:
        """Servos that cannot be used can still be released."""
        wanted = Order.RELEASE in self._orders
        self._orders.clear()
        if not wanted:
            return
        for port in self._search.ports():
            with contextlib.suppress(BusError):
                release_all(ServoBus(port), self._settings.ids)
            port.close()

    def _serve(self, bus: ServoBus) -> None:
        """Cycle on a bus until the end, or until it raises."""
        self.state, self.port = DeviceState.PREPARING, bus.port.path
        self.counters = bus.counters
        try:
            self.servos.connect(bus)
        except ModuleError:
            if Order.RELEASE in self._orders:
                release_all(bus, self._settings.ids)
            self._orders.clear()
            raise
        self._orders.clear()
        self.reconnects += self._connected_before
        self._connected_before = True
        self.servos.event = 0
        self.times.restart()
        deadline_ns = time.monotonic_ns()
        while not self._closing.is_set():
            if self._orders:
                self._obey(self._orders.popleft())
            self._cycle()
            deadline_ns += self._period_ns
            wait_ns = deadline_ns - time.monotonic_ns()
            if wait_ns > 0:
                time.sleep(wait_ns * 1e-9)
            elif wait_ns < -self._period_ns:
                deadline_ns = time.monotonic_ns()
        with contextlib.suppress(BusError):
            disarm_watchdogs(bus, self._settings.ids)

    def _obey(self, order: Order) -> None:
        servos = self.servos
        self.state = DeviceState.PREPARING
        acts = {
            Order.HOLD: servos.hold,
            Order.RELEASE: servos.release,
            Order.TAKE_HOLD: servos.take_hold,
            Order.HOME: servos.home,
            Order.REBOOT: servos.reboot,
        }
        try:
            acts[order]()
        except (ServoRefused, ServoSilent) as error:
            servos.message = str(error)

    def _cycle(self) -> None:
        servos, command = self.servos, self.command
        begin_ns = time.monotonic_ns()
        complete = servos.step(command.angles, command.moving, begin_ns - command.stamp_ns)
        self.times.add(begin_ns, time.monotonic_ns(), complete)
        readiness = servos.readiness
        if servos.event:
            self.state = DeviceState.FAULT
        else:
            busy = readiness == Readiness.BUSY
            self.state = DeviceState.HOMING if busy else DeviceState.CONNECTED
        self.snapshot = self._newest(int(readiness))

    def _newest(self, readiness: int) -> Snapshot:
        servos = self.servos
        assert servos.cycle is not None
        servos.transmission.angles(servos.cycle.position, self._angles)
        angles = tuple(self._angles.tolist())
        valid = servos.event != Event.SERVO_SILENT
        stamp_ns = min(servos.stamps_ns)
        return Snapshot(stamp_ns, angles, servos.loads(), valid, servos.event, readiness)
