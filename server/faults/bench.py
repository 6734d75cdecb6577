"""A running console with a leader that drives it: what faults are injected into."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from benchmarks.console import Console
from hardware.devices import DEVICES
from hardware.fake_servos.client import FakeServos, FakeServosProcess
from robot.configuration import Configuration
from robot.records import Readiness, Safety
from robot.safety import REASONS, Event
from robot.sensing.alignment import REACH_S
from server.faults.access import Answer, Api
from server.faults.clock import SettableClock
from server.faults.demands import BenchFailed, Deadline
from server.faults.leading import Circle, StreamLeader
from server.faults.stylus import StylusProcess
from server.faults.watching import Records, Watch, commanded_path_mm, reason, safety
from server.memory.link_records import DEVICES_FILE, SUPERVISION, SUPERVISION_FILE
from server.memory.mapped import MappedReadError, MappedSlot
from server.memory.stylus_records import STYLUS_STATUS, STYLUS_STATUS_FILE

_ARM_S, _RECOVER_S = 25.0, 60.0
_REPLY_MS = 8.0
"""How long a cycle waits for its answers: wire, adapter and patience at 1 M baud."""
_PATIENCE = "wait"
_GO_HOME_S, _AT_HOME_MM, _TURN_RAD = 3.0, 0.5, 1.4
_UNDER_WAY_MM = 1.0
_LOOK_S = 0.02
WATCHDOG_MS, HANG_UP_MS, WEB_SILENT_MS, HUNG_MS = 60.0, 100.0, 1100.0, 6000.0


class Bench:
    """A console on a free port, driven through its API, for the length of a ``with`` block.

    Args:
        folder: for its run directory and everything it writes.
        configuration: of the console.
        hardware: whether it drives servos, simulated ones on a pseudo-terminal, and is led by a
            simulated stylus.

    Attributes:
        console: the processes. api: the operator's. watch: sees every record.
        page: the operator's; it leads where there is no stylus.
        clock: the wall clock of its processes.
        servos, stylus: control channels of the simulated bus and stylus; None without them.
    """

    def __init__(
        self,
        folder: Path,
        configuration: Configuration,
        *,
        hardware: bool = False,
    ) -> None:
        self.folder, self.configuration, self.hardware = folder, configuration, hardware
        self.servos: FakeServos | None = None
        self.stylus: FakeServos | None = None
        self.clock = SettableClock(folder / "clock")
        self._environment = {"XDG_DATA_HOME": str(folder / "data"), **self.clock.environment}
        self._rest = contextlib.ExitStack()

    def __enter__(self) -> Self:
        folder = self.folder
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "configuration.json"
        file.write_text(self.configuration.model_dump_json(), encoding="utf-8")
        arguments: tuple[str, ...] = ()
        with contextlib.ExitStack() as stack:
            if self.hardware:
                link = folder / "servos"
                baud = str(self.configuration.servos.baud_rate)
                self.servos = stack.enter_context(FakeServosProcess(link, "--baud", baud)).servos
                stylus = stack.enter_context(StylusProcess(folder))
                self.stylus = stylus.channel
                arguments = ("--robot", "hardware", "--servos", f"{link}*")
                arguments += ("--stylus", stylus.address)
            run = folder / "run"
            self.console = stack.enter_context(
                Console(run, str(file), arguments, environment=self._environment)
            )
            self.console.wait_until_running()
            self.watch = Watch(run)
            stack.callback(self.watch.close)
            self._supervision = MappedSlot(run / SUPERVISION_FILE, SUPERVISION)
            stack.callback(self._supervision.close)
            self.api = Api(self.console.base, self.console.token)
            self.api.take_lease()
            stands = self.watch.newest()["outcome"]["report"][0]
            self._home_mm = stands["commanded_position"] * 1e3
            self._home_wxyz = stands["commanded_wxyz"].copy()
            self.page = StreamLeader(self.api, Circle(self._home_mm), leads=self.stylus is None)
            stack.callback(self.page.close)
            self._devices = MappedSlot(run / DEVICES_FILE, DEVICES)
            stack.callback(self._devices.close)
            self._rest = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._rest.close()

    @property
    def bus_ms(self) -> float:
        """Two missed cycles of the servo bus, ms: each ends when its answers do not come."""
        return 1e3 / self.configuration.servos.rate_hz + 2.0 * _REPLY_MS

    def limit_ms(self, deadline: Deadline) -> float:
        """A deadline as a number, ms; two ticks for the loop and the clock that is read."""
        tick_ms = 1e3 / self.configuration.control.rate_hz
        leader_ms = self.configuration.teleoperation.api_timeout_ms
        return {
            Deadline.LEADER: leader_ms + 2.0 * tick_ms,
            Deadline.BUS: self.bus_ms + 2.0 * tick_ms,
            Deadline.HANG_UP: HANG_UP_MS,
            Deadline.WATCHDOG: WATCHDOG_MS,
            Deadline.LOST_WEB: WEB_SILENT_MS,
            Deadline.HUNG: HUNG_MS,
            Deadline.LATE: 200.0,
            Deadline.FLAT: self.configuration.tension_unit.cell_flat_ms + 2.0 * tick_ms,
            Deadline.ALIGNED: REACH_S * 1e3 + 2.0 * tick_ms,
            Deadline.TOLD: 200.0,
            Deadline.RESTART: 5000.0,
            Deadline.RECORDER: 2000.0,
            Deadline.START: 30_000.0,
            Deadline.ANSWER: 1000.0,
        }[deadline]

    def ask(self, act: str) -> Answer:
        """POST one of the API's acts."""
        return self.api.call("POST", f"/{act}")

    @staticmethod
    def wait(condition: Callable[[], bool], what: str, within_s: float = 15.0) -> None:
        """Wait until it holds.

        Raises:
            BenchFailed: it does not.
        """
        ends = time.monotonic() + within_s
        while not condition():
            if time.monotonic() > ends:
                raise BenchFailed(f"not within {within_s:g} s: {what}")
            time.sleep(_LOOK_S)

    def pid(self, name: str) -> int:
        """Process id of ``control`` or ``web``; 0 while it is down."""
        try:
            return int(self._supervision.read()[f"{name}_pid"][0])
        except MappedReadError:
            return 0

    def devices(self) -> Records:
        """What control says of its devices, () DEVICES; zeros before the first word."""
        try:
            return np.asarray(self._devices.read()[0])
        except MappedReadError:
            return np.zeros((), DEVICES)

    def audit(self, event: str) -> list[dict[str, Any]]:
        """The newest entries of one kind in the audit log."""
        found = self.api.call("GET", "/audit?last=200").items
        return [one for one in found if one.get("event") == event]

    def bus_text(self, field: str) -> str:
        """A text of what control says of the bus."""
        return bytes(self.devices()["bus"][field]).decode(errors="replace").rstrip("\0")

    def stylus_count(self, name: str) -> int:
        """One of the counters of what came from the stylus; see ``STYLUS_COUNTS``."""
        status = MappedSlot(self.console.directory / STYLUS_STATUS_FILE, STYLUS_STATUS)
        try:
            return int(status.read()["counts"][name][0])
        finally:
            status.close()

    def supervision(self) -> Records:
        """What the supervisor says, (1,) SUPERVISION."""
        return self._supervision.read()

    def signal(self, name: str, number: signal.Signals) -> int:
        """Send a signal to control or web; when, ns."""
        began = time.monotonic_ns()
        os.kill(self.pid(name), number)
        return began

    def now(self) -> tuple[Safety, Event]:
        """State and reason of the newest record."""
        newest = self.watch.newest()
        return Safety(int(safety(newest)[0])), Event(int(reason(newest)[0]))

    def arm(self) -> None:
        """Bring the robot to ENABLED, driven by the leader, as a person would.

        Raises:
            BenchFailed: it does not get there.
        """
        ends = time.monotonic() + _ARM_S
        self.page.quiet = False
        self.page.tamper(None)
        while time.monotonic() < ends:
            self.press(False)
            self.recover()
            if self.drives():
                return
        state, why = self.now()
        raise BenchFailed(
            f"the robot is not driven within {_ARM_S:g} s: {state.name}, {REASONS[why][0]}"
        )

    def press(self, closed: bool) -> None:
        """Close the leader's clutch, or open it."""
        if self.stylus is None:
            self.page.clutch = closed
        elif closed:
            self.stylus.ask(press=1)
        else:
            self.stylus.ask(release=True)

    def drives(self, within_s: float = 3.0) -> bool:
        """Close the clutch anew; whether the commanded tip then goes with the leader."""
        self.press(False)
        time.sleep(0.05)
        if self.stylus is not None:
            self._go_home()
        at = self.watch.newest()["outcome"]["report"]["commanded_position"][0] * 1e3
        self.page.circle.begin_at(np.array(at))
        self.press(True)
        self.watch.mark()
        ends = time.monotonic() + within_s
        while time.monotonic() < ends:
            records = self.watch.records()
            if len(records) and safety(records[-1:])[0] != Safety.ENABLED:
                return False
            if commanded_path_mm(records) > _UNDER_WAY_MM:
                return True
            time.sleep(_LOOK_S)
        return False

    def turned_home(self) -> dict[str, list[float]]:
        """A target at home, turned so far that the segment has to bend; for the API."""
        half, (w, x, y, z) = 0.5 * _TURN_RAD, self._home_wxyz
        c, s = math.cos(half), -math.sin(half)
        turned = (c * w - s * x, c * x + s * w, c * y - s * z, c * z + s * y)
        return {
            "position_mm": [float(one) for one in self._home_mm],
            "orientation_wxyz": [float(one) for one in turned],
        }

    def _go_home(self) -> None:
        """A stylus leads from wherever the tip is: bring it back, or it wanders off in the end."""
        target = {
            "position_mm": [float(one) for one in self._home_mm],
            "orientation_wxyz": [float(one) for one in self._home_wxyz],
        }
        if not self.api.call("POST", "/target", target).ok:
            return
        ends = time.monotonic() + _GO_HOME_S
        while time.monotonic() < ends:
            at = self.watch.newest()["outcome"]["report"]["commanded_position"][0] * 1e3
            if float(np.linalg.norm(at - self._home_mm)) < _AT_HOME_MM:
                return
            time.sleep(_LOOK_S)

    def recover(self) -> tuple[str, ...]:
        """Do what a person does after a fault, one act after the other, until the robot is ENABLED.

        Returns:
            The acts: endpoints of the API.

        Raises:
            BenchFailed: it does not get there.
        """
        acts: list[str] = []
        ends = time.monotonic() + _RECOVER_S
        while time.monotonic() < ends:
            self.api.take_lease()
            act = self._next_act()
            if act == "":
                return tuple(acts)
            if act != _PATIENCE and self.ask(act).ok:
                acts += [act] if acts[-1:] != [act] else []
            time.sleep(0.05)
        state, why = self.now()
        detail = self.ask("enable").body.get("detail", "")
        raise BenchFailed(f"no way out of {state.name}, {REASONS[why][0]}: {detail}")

    def _next_act(self) -> str:
        newest = self.watch.newest()
        state, _ = self.now()
        readiness = Readiness(int(newest["input"]["readiness"][0]))
        act = "enable"
        if state == Safety.ENABLED:
            act = ""
        elif readiness in (Readiness.NOT_CONNECTED, Readiness.BUSY):
            act = _PATIENCE
        elif readiness == Readiness.DEVICE_FAULT:
            act = "devices/reboot"
        elif state == Safety.FAULT:
            act = "reset"
        elif readiness == Readiness.TORQUE_OFF:
            act = "torque/hold"
        elif readiness == Readiness.NOT_HOMED:
            act = "home" if state == Safety.DISABLED else "disable"
        return act

    def inject(self, name: str) -> int:
        """Break the simulated robot; when control took the request in, ns."""
        return self._taken(self.api.call("POST", "/faults", {"name": name}))

    def hold_tendons(self, control: str) -> None:
        """Choose what the drives of the tendons hold.

        Raises:
            BenchFailed: it was refused.
        """
        answer = self.api.call("PUT", "/tendons", {"control": control})
        if not answer.ok:
            raise BenchFailed(f"{control} control was refused: {answer.body}")

    def mend(self) -> None:
        """Mend the simulated robot."""
        self.api.call("DELETE", "/faults")

    def _taken(self, answer: Answer) -> int:
        """The stamp of the last record without what has just been asked for."""
        if not answer.ok:
            raise BenchFailed(f"the fault was refused: {answer.body}")
        records = self.watch.records()
        numbers = records["header"]["request_sequence"]
        later = np.flatnonzero(numbers > numbers[0])
        place = max(0, int(later[0]) - 1) if len(later) else len(records) - 1
        return int(records["header"]["stamp_ns"][place])
