"""A running console with a leader that drives it: what faults are injected into."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from benchmarks.console import Console
from hardware.fake_servos.client import FakeServosProcess
from robot.configuration import Configuration
from robot.records import Request, Safety
from robot.safety import REASONS, Event
from server.faults.access import Answer, Api
from server.faults.fault import BenchFailed, Deadline
from server.faults.leading import Circle, StreamLeader
from server.faults.watching import Records, Watch, commanded_path_mm, reason, safety
from server.memory.link_records import SUPERVISION, SUPERVISION_FILE
from server.memory.mapped import MappedReadError, MappedSlot
from server.supervision.child_process import module_environment

_ARM_S = 20.0
_UNDER_WAY_MM = 1.0
_LOOK_S = 0.02
_HOMING_S = 60.0
WATCHDOG_MS, HANG_UP_MS, WEB_SILENT_MS, HUNG_MS = 60.0, 100.0, 1100.0, 6000.0


class Bench:
    """A console on a free port, driven through its API, for the length of a ``with`` block.

    Args:
        folder: for its run directory and everything it writes.
        configuration: of the console.
        hardware: whether it drives servos, simulated ones on a pseudo-terminal.
        sitecustomize: a folder that goes before all others on the processes' module path.

    Attributes:
        console: the processes. api: the operator's. leader: drives. watch: sees every record.
        servos: the simulated servo bus; None without one.
    """

    def __init__(
        self,
        folder: Path,
        configuration: Configuration,
        *,
        hardware: bool = False,
        sitecustomize: Path | None = None,
    ) -> None:
        self.folder, self.configuration, self.hardware = folder, configuration, hardware
        self.servos: FakeServosProcess | None = None
        self._environment = {"XDG_DATA_HOME": str(folder / "data")}
        if sitecustomize is not None:
            known = module_environment().get("PYTHONPATH", "")
            self._environment["PYTHONPATH"] = f"{sitecustomize}{os.pathsep}{known}"
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
                self.servos = stack.enter_context(FakeServosProcess(link, "--baud", baud))
                arguments = ("--robot", "hardware", "--servos", str(link))
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
            home = self.watch.newest()["outcome"]["report"]["commanded_position"][0] * 1e3
            self.leader = StreamLeader(self.api, Circle(home))
            stack.callback(self.leader.close)
            if self.hardware:
                self.home()
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
        """Two missed cycles of the servo bus, and the deadline of a reply, ms."""
        return 2e3 / self.configuration.servos.rate_hz + _REPLY_MS

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
            Deadline.ANSWER: 1000.0,
        }[deadline]

    def home(self) -> None:
        """Find the tendons' zero, as a person does before the first enabling."""
        self.ask("home")
        self.wait(
            lambda: bool(self.watch.newest()["input"]["readiness"][0] == 0), "homing", _HOMING_S
        )

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
        self.leader.quiet = False
        self.leader.tamper(None)
        while time.monotonic() < ends:
            if self._arm_once():
                return
        state, why = self.now()
        raise BenchFailed(
            f"the robot is not driven within {_ARM_S:g} s: {state.name}, {REASONS[why][0]}"
        )

    def _arm_once(self) -> bool:
        self.leader.clutch = False
        if not self.api.take_lease():
            time.sleep(0.1)
            return False
        state, _ = self.now()
        if state == Safety.FAULT:
            self.ask("reset")
        if state != Safety.ENABLED and not self.ask("enable").ok:
            time.sleep(0.1)
            return False
        time.sleep(0.05)
        return self.drives()

    def drives(self, within_s: float = 3.0) -> bool:
        """Close the clutch anew; whether the commanded tip then goes with the leader."""
        self.leader.clutch = False
        time.sleep(0.04)
        at = self.watch.newest()["outcome"]["report"]["commanded_position"][0] * 1e3
        self.leader.circle.begin_at(np.array(at))
        self.leader.clutch = True
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

    def recover(self, recovery: tuple[str, ...]) -> bool:
        """Do what a person does after a fault; whether the robot is driven again."""
        self.api.take_lease()
        for act in recovery:
            if act == "home":
                self.home()
            elif act in _WAITS:
                self.ask(act)
                self.wait_ready()
            else:
                self._until_ok(act)
        return self.drives()

    def _until_ok(self, act: str) -> None:
        ends = time.monotonic() + _ARM_S
        while not self.ask(act).ok:
            if time.monotonic() > ends:
                raise BenchFailed(f"{act} was refused for {_ARM_S:g} s: {self.ask(act).body}")
            time.sleep(0.05)
            self.api.take_lease()

    def wait_ready(self) -> None:
        """Wait until the devices are."""
        self.wait(
            lambda: bool(self.watch.newest()["input"]["readiness"][0] == 0), "devices are ready"
        )

    def inject(self, name: str) -> int:
        """Break the simulated robot; when control took the request in, ns."""
        return self._taken(self.api.call("POST", "/fault", {"fault": name}))

    def mend(self) -> None:
        """Mend the simulated robot."""
        self.api.call("DELETE", "/fault")

    def _taken(self, answer: Answer) -> int:
        """The stamp of the last record without what has just been asked for."""
        if not answer.ok:
            raise BenchFailed(f"the fault was refused: {answer.body}")
        records = self.watch.records()
        numbers = records["header"]["request_sequence"]
        later = np.flatnonzero(numbers > numbers[0])
        place = max(0, int(later[0]) - 1) if len(later) else len(records) - 1
        return int(records["header"]["stamp_ns"][place])


_REPLY_MS = 4.0
_WAITS = ("reboot-devices",)
_NOTHING = Request.NONE
