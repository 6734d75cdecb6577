"""The four servos of the module while they are connected: one cycle, and what happens between.

All of it runs in the module's thread. What is remembered here outlives a lost port: the zero stays
true as long as the servos keep their torque.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

from hardware.module.errors import ModuleError, NoRoom
from hardware.module.following import Follower
from hardware.module.homing import Homing
from hardware.module.preparation import (
    Prepared,
    ServoStatus,
    prepare,
    read_status,
    reboot_all,
    release_all,
    torque_on,
)
from hardware.module.remembering import forget_zero, remember_zero, remembered_zero
from hardware.module.transmission import Transmission
from hardware.module.watching import ServoWatch
from hardware.servos.bus import ServoBus
from hardware.servos.control_table import TABLE, WATCHDOG_TRIPPED, HardwareError
from hardware.servos.cyclic import ALL, CyclicExchange
from hardware.servos.errors import ServoRefused, ServoSilent, fault_message
from robot.configuration import Configuration
from robot.records import SERVOS, Readiness
from robot.safety import Event

PATIENCE_S, _PATIENCE_PERIODS = 0.004, 1.0
"""How late an answer may be. At 250 Hz a miss ends after 8 ms, two of them within the limit of the
bus: one period, two misses and two ticks."""
_RESERVE = 1.3
"""How much faster than commands may be the goals may catch up."""
_STATUS_EVERY_S = 0.05
"""Between two readings of what the cycle does not read, of one servo after the other."""
_LASTS_NS = 500_000_000
"""How long an event is told at least: nobody overlooks it, and it does not flicker."""
_TOLERANCE_RAD = math.radians(3.0)
_SLACK_RAD = math.radians(3.0)
"""Servos that turned so far without torque have let their tendons go."""
_LOAD_SHARE = 0.01 * TABLE["present_load"].unit_scale


class ModuleServos:
    """Four servos on a connected bus.

    Attributes:
        transmission: zero and directions.
        follower: their goals.
        watch: what is wrong with them.
        homed: whether the zero is known.
        torque: of each servo.
        prepared: who they are; None before the first connection.
        cycle: the exchange; None while not connected.
        event: a ``robot.safety.Event`` that is told now; 0 without one.
        message: what people should know now.
        homing: in progress, or None.
        stamps_ns: when each servo answered last.
    """

    def __init__(self, configuration: Configuration, patience_s: float = PATIENCE_S) -> None:
        """Servos that have never been connected.

        Args:
            configuration: of the bus and the module.
            patience_s: how late an answer may be; more where it lasts longer than a cycle.
        """
        self.settings = configuration.servos
        self.transmission = Transmission(configuration)
        speed = math.radians(configuration.module.servo_speed_deg_s) * _RESERVE
        self.follower = Follower(self.transmission, speed)
        self.watch = ServoWatch(self.settings, self.transmission.ticks_per_rad)
        self.homed = False
        self.torque = [False] * SERVOS
        self.errors = [HardwareError(0)] * SERVOS
        self.prepared: Prepared | None = None
        self.cycle: CyclicExchange | None = None
        self.event, self.message = 0, ""
        self.homing: Homing | None = None
        self.stamps_ns = [0] * SERVOS
        self._period_s = 1.0 / self.settings.rate_hz
        self._slack = _SLACK_RAD * self.transmission.ticks_per_rad
        self._patience_s = max(patience_s, _PATIENCE_PERIODS * self._period_s)
        self._limit = (
            self.transmission.half_range + _TOLERANCE_RAD * self.transmission.ticks_per_rad
        )
        self._released = self._silent = False
        self._origin: list[float] | None = None
        self._until_ns = 0
        self._last_ns = 0
        self._gap_ns = round(0.75e6 * self.settings.watchdog_ms)
        self._status_every = max(1, round(_STATUS_EVERY_S / self._period_s))
        self._cycles = self._next_status = 0

    # Connecting

    def connect(self, bus: ServoBus) -> None:
        """Prepare the servos on ``bus``; they hold where they are and follow nothing yet.

        Raises:
            BusError: if one does not answer or refuses.
            ModuleError: if they are not what is configured, or must be released first.
        """
        self._bus = bus
        known = self.prepared is not None
        self.prepared = prepare(bus, self.settings)
        self.cycle = CyclicExchange(bus, self.settings.ids, self.prepared.fast, self._patience_s)
        for index, status in enumerate(self.prepared.status):
            self._note(index, status)
        if not all(self.torque):
            forget_zero(bus, self.settings)
        if not (all(self.torque) or self._released):
            if self.homed:
                self.message = "the servos have lost their torque; home again"
            self.homed = False
        elif known and self.homed:
            self.message = "connected again; enable to go on"
        elif not known and all(self.torque):
            self._take_up(bus)
        self.follower.take(self.prepared.goals)
        self.follower.hold(self.prepared.goals, (0,) * SERVOS)
        self.cycle.position[:] = self.prepared.position
        self.watch.forget(self.cycle, self.follower.goals)
        self._last_ns = time.monotonic_ns()
        self.stamps_ns = [self._last_ns] * SERVOS

    def _take_up(self, bus: ServoBus) -> None:
        """Servos that have held ever since another host homed them need no homing."""
        zero = remembered_zero(bus, self.settings)
        if zero is None:
            return
        try:
            self.transmission.set_zero(zero)
        except NoRoom:
            return
        self.homed = True
        self._origin = [float(tick) for tick in zero]
        self.message = "the servos held on; enable to go on"

    def disconnect(self) -> None:
        """The port is gone; the servos stop by their watchdogs."""
        self._silent = False
        self.cycle = None
        self.homing = None
        self.follower.holding = True

    def _note(self, index: int, status: ServoStatus) -> None:
        self.torque[index] = status.torque
        self.errors[index] = status.error

    # One cycle

    def step(self, angles: Sequence[float], moving: bool, age_ns: int) -> bool:
        """Do one cycle; True if all servos answered.

        Args:
            angles: newest command, rad.
            moving: whether it is one of a motion.
            age_ns: how long ago it was given.

        Raises:
            PortLost: if the port is gone.
            BusError: if a servo that must be prepared anew does not take part.
        """
        cycle, follower = self.cycle, self.follower
        assert cycle is not None
        now_ns = time.monotonic_ns()
        passed_ns = now_ns - self._last_ns
        self._last_ns = now_ns
        if self.homing is None and self.homed and not self.event:
            dt_s = min(passed_ns * 1e-9, 2.0 * self._period_s)
            follower.follow(angles, moving, age_ns, dt_s)
        answered = cycle.exchange(follower.goals)
        now_ns = time.monotonic_ns()
        for index in range(SERVOS):
            if answered >> index & 1:
                self.stamps_ns[index] = now_ns
        self.watch.look(answered, cycle, follower.goals)
        if passed_ns > self._gap_ns:
            self._after_a_gap()
        elif self._silent and answered == ALL:
            self._silent = False
            self._begin_anew(Event.SERVO_SILENT, "a servo was silent and answers again")
        else:
            self._look_deeper(answered == ALL)
        self._decide(now_ns)
        if not (follower.holding or self.event):
            self.message = ""
        if follower.refusing and not self.event:
            self.message = "the motion does not begin where the servos are; disable, then enable"
        if self.homing is not None and answered == ALL:
            self._home_on(cycle)
        return answered == ALL

    def _decide(self, now_ns: int) -> None:
        """Tell the watch's event, and hold when there is one."""
        if self.watch.event:
            self._silent = self._silent or self.watch.event == Event.SERVO_SILENT
            self._tell(self.watch.event, self.watch.message, now_ns)
        elif any(self.errors):
            self._tell(Event.SERVO_FAULT, "", now_ns)
        elif self.event and now_ns > self._until_ns:
            self.event = 0

    def _tell(self, event: int, message: str, now_ns: int = 0) -> None:
        if not self.event:
            self.hold()
        faulty = [index for index in range(SERVOS) if self.errors[index]]
        if faulty and event == Event.SERVO_FAULT:
            index = faulty[0]
            message = fault_message(self.settings.ids[index], self.errors[index])
        self.event, self.message = int(event), message
        self._until_ns = (now_ns or time.monotonic_ns()) + _LASTS_NS

    # Beside the cycle

    def _look_deeper(self, complete: bool) -> None:
        """Read what the cycle does not, of a servo that has just alerted or of the next in turn.

        After a cycle that was not ``complete`` the next one decides whether a servo is silent: a
        read that fails too would only delay it.
        """
        self._cycles += 1
        alerting = [
            index
            for index in range(SERVOS)
            if self.watch.alerts >> index & 1 and not self.errors[index]
        ]
        if alerting:
            self._read_status(alerting[0])
        elif complete and self._cycles % self._status_every == 0:
            self._next_status = (self._next_status + 1) % SERVOS
            if not self.watch.missed[self._next_status]:
                self._read_status(self._next_status)

    def _read_status(self, index: int) -> None:
        try:
            status = read_status(self._bus, self.settings.ids[index], tries=1)
        except (ServoSilent, ServoRefused):
            # The cycle will miss it too if it is more than one bad answer.
            return
        had = self.torque[index]
        self._note(index, status)
        if status.watchdog == WATCHDOG_TRIPPED:
            self._begin_anew(Event.BUS_LOST, "the bus was silent for too long")
        elif had and not status.torque and not status.error:
            self.homed = False
            forget_zero(self._bus, self.settings)
            servo = self.settings.ids[index]
            self._begin_anew(Event.SERVO_FAULT, f"servo {servo} lost its torque; home again")

    def _after_a_gap(self) -> None:
        """The servos may have stopped by themselves; if they have, begin anew."""
        for index in range(SERVOS):
            if not self.watch.missed[index]:
                self._read_status(index)
        self._last_ns = time.monotonic_ns()

    def _begin_anew(self, event: Event, message: str) -> None:
        """Prepare all servos again: one of them forgot, or stopped listening."""
        self._tell(event, message)
        self.connect(self._bus)
        self.message = message

    # Orders

    def hold(self) -> None:
        """Stay where they are and follow nothing."""
        if self.cycle is not None:
            self.follower.hold(self.cycle.position, self.cycle.load)
        self.homing = None

    def release(self) -> None:
        """Take torque off all, whatever one of them does."""
        self.hold()
        self._released = True
        forget_zero(self._bus, self.settings)
        unsure = release_all(self._bus, self.settings.ids)
        self.torque = [False] * SERVOS
        self.message = "torque is off; take hold to go on"
        if unsure:
            names = " ".join(str(servo) for servo in unsure)
            self.message = f"torque is off, but servo {names} did not confirm: cut its power"
        self._last_ns = time.monotonic_ns()

    def take_hold(self) -> None:
        """Put torque on where they stand."""
        goals = list(self.follower.goals)
        torque_on(self._bus, self.settings.ids)
        self._released = False
        self.message = ""
        self._begin(self._bus)
        moved = max(abs(a - b) for a, b in zip(goals, self.follower.goals, strict=True))
        if self.homed and moved > self._slack:
            self.homed = False
            self.message = "the tendons went slack without torque; home"
        if self.homed:
            remember_zero(self._bus, self.settings, self.transmission.zero)

    def _begin(self, bus: ServoBus) -> None:
        message = self.message
        self.connect(bus)
        self.message = message

    def reboot(self) -> None:
        """Start servos anew that have switched themselves off; all of them lose torque."""
        self.hold()
        reboot_all(self._bus, self.settings.ids)
        self.homed, self._released = False, False
        self.torque = [False] * SERVOS
        self.message = "started anew; home"
        self.event = 0
        self._begin(self._bus)

    def home(self) -> None:
        """Begin to home; the cycle goes on with it."""
        if not all(self.torque):
            self.take_hold()
        self._released = False
        self.homed = False
        forget_zero(self._bus, self.settings)
        self.message = "homing"
        self.homing = Homing(self.transmission, self.settings, self._period_s, self._origin)

    def _home_on(self, cycle: CyclicExchange) -> None:
        assert self.homing is not None
        try:
            done = self.homing.step(cycle.position, cycle.load)
            self.follower.take(self.homing.goals)
            self._origin = self.homing.origin
            if done:
                self.transmission.set_zero(self.follower.goals)
                self._origin = list(self.homing.goals)
                self.homed, self.message = True, ""
                self.homing = None
                remember_zero(self._bus, self.settings, self.transmission.zero)
        except ModuleError as error:
            self.hold()
            self.message = str(error)

    # What they say

    @property
    def readiness(self) -> Readiness:
        """Whether the robot may be enabled."""
        if self.cycle is None:
            return Readiness.NOT_CONNECTED
        if self.event:
            return Readiness.DEVICE_FAULT
        if self.homing is not None:
            return Readiness.BUSY
        if not (self.homed and all(self.torque)):
            return Readiness.TORQUE_OFF if self.homed else Readiness.NOT_HOMED
        away = zip(self.cycle.position, self.transmission.zero, strict=True)
        if max(abs(position - zero) for position, zero in away) > self._limit:
            return Readiness.OUTSIDE_LIMITS
        return Readiness.READY

    def loads(self) -> tuple[float, ...]:
        """Share of its largest load of each servo, -1 to 1; negative while it pulls its tendon."""
        if self.cycle is None:
            return (0.0,) * SERVOS
        directions = self.transmission.directions
        pairs = zip(directions, self.cycle.load, strict=True)
        return tuple(direction * load * _LOAD_SHARE for direction, load in pairs)
