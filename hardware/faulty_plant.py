"""A simulated robot that breaks on request, to show what the console does about it.

Every fault is data: what the wrapped plant says, does or takes is changed in one of few ways,
always the same way, and from the next tick on. Without a fault nothing is changed or copied.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hardware.plant import Measurement, Plant, PlantSpec
from hardware.tension_unit.module import UnitFault
from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.records import Readiness
from robot.safety import Event
from scenes.boards.board import Board

_NOBODY = -1


class PlantBroke(RuntimeError):
    """What a plant raises whose code is wrong; a program must survive also what nobody expects."""


@dataclass(frozen=True)
class PlantFault:
    """One way in which a robot can break.

    Attributes:
        title: for people.
        valid: whether measurements still count as valid.
        silent: measurements get older and stay as they were.
        event: what the devices tell, as long as the fault lasts.
        readiness: likewise.
        contact_n: force that the scene's sensor reads on top of what there is, N.
        offset_joint: the joint whose measurement is off by ``offset_rad``.
        offset_rad: by how much, rad (a tube's translation: m); NaN for no number at all.
        stuck_joint: the joint that stays where it is, whatever it is told.
        stuck_servo: likewise among the servos.
        module: the module of the tension-feedback unit that breaks.
        unit: how it breaks.
        tracker_lost: whether the tip tracker's last pose only gets older.
        late_s: how much too late the next tick begins, s; once.
        fails: whether the plant's own code raises.
        shows_nothing: whether the truth, which is for pictures only, is no number.
    """

    title: str
    valid: bool = True
    silent: bool = False
    event: Event = Event.NOTHING
    readiness: Readiness = Readiness.READY
    contact_n: float = 0.0
    offset_joint: int = _NOBODY
    offset_rad: float = 0.0
    stuck_joint: int = _NOBODY
    stuck_servo: int = _NOBODY
    module: int = _NOBODY
    unit: UnitFault = UnitFault.NONE
    tracker_lost: bool = False
    late_s: float = 0.0
    fails: bool = False
    shows_nothing: bool = False


_OUT = Readiness.NOT_CONNECTED
_BROKEN = Readiness.DEVICE_FAULT

FAULTS: dict[str, PlantFault] = {
    "measurement-lost": PlantFault("Measurements are marked as invalid", valid=False),
    "measurement-silent": PlantFault("Measurements stop coming", silent=True),
    "measurement-nan": PlantFault(
        "A joint is measured as no number", offset_joint=3, offset_rad=math.nan
    ),
    "joint-stuck": PlantFault("The arm's fourth joint is stuck", stuck_joint=3),
    "servo-stuck": PlantFault("The first servo is stuck", stuck_servo=0),
    "encoder-jump": PlantFault(
        "A joint's encoder jumps by 20 degrees", offset_joint=1, offset_rad=math.radians(20.0)
    ),
    "arm-pushed": PlantFault(
        "Something pushes the arm off the trocar", offset_joint=0, offset_rad=0.035
    ),
    "outside-limits": PlantFault(
        "A joint stands outside its limits",
        offset_joint=3,
        offset_rad=math.radians(-400.0),
        readiness=Readiness.OUTSIDE_LIMITS,
    ),
    "contact": PlantFault("The instrument presses on something", contact_n=20.0),
    "late-tick": PlantFault("A tick comes 150 ms late", late_s=0.15),
    "plant-exception": PlantFault("The plant's code fails", fails=True),
    "simulation-broken": PlantFault("The simulation breaks down", event=Event.SIMULATION_FAILED),
    "bus-lost": PlantFault("The servo bus is gone", event=Event.BUS_LOST, readiness=_OUT),
    "servo-silent": PlantFault(
        "A servo does not answer", event=Event.SERVO_SILENT, readiness=_BROKEN
    ),
    "servo-overload": PlantFault("A servo is overloaded", event=Event.SERVO_FAULT),
    "arm-lost": PlantFault("The arm is gone", event=Event.ARM_LOST, readiness=_OUT),
    "arm-error": PlantFault("The arm reports an error", event=Event.ARM_FAULT, readiness=_BROKEN),
    "cell-missing": PlantFault(
        "A torque cell gives no reading", module=2, unit=UnitFault.CELL_MISSING
    ),
    "cell-saturated": PlantFault(
        "A torque cell is at its end", module=1, unit=UnitFault.CELL_SATURATED
    ),
    "cell-flat": PlantFault(
        "A torque cell's reading stays as it is", module=0, unit=UnitFault.CELL_FLAT
    ),
    "tendon-broken": PlantFault("A tendon breaks", module=0, unit=UnitFault.TENDON_BROKEN),
    "tracker-lost": PlantFault("The tracker does not see the tip", tracker_lost=True),
    "picture-impossible": PlantFault("The picture cannot be drawn", shows_nothing=True),
}
"""What can be injected into the simulated instrument, by name."""

_WITH_TUBES = ("measurement-lost", "measurement-silent", "late-tick", "plant-exception",
               "simulation-broken", "picture-impossible")  # fmt: skip

TUBE_FAULTS: dict[str, PlantFault] = {
    **{name: FAULTS[name] for name in _WITH_TUBES},
    "measurement-nan": PlantFault(
        "A tube is measured as no number", offset_joint=0, offset_rad=math.nan
    ),
    "tube-stuck": PlantFault("Arm A's innermost tube is stuck", stuck_joint=0),
    "encoder-jump": PlantFault(
        "The encoder of arm A's innermost tube jumps by 10 mm", offset_joint=0, offset_rad=0.01
    ),
}
"""What can be injected into simulated concentric-tube arms."""


def plant_faults(configuration: Configuration) -> dict[str, PlantFault]:
    """What can be injected into the simulated robot of that configuration."""
    if configuration.robot == "concentric":
        return TUBE_FAULTS
    simulation = configuration.simulation
    if simulation.actuation == "tension-unit" and simulation.plant == "physics":
        return FAULTS
    return {name: fault for name, fault in FAULTS.items() if fault.unit is UnitFault.NONE}


class BreakableUnit(Protocol):
    """A tension-feedback unit whose modules can be broken."""

    def break_module(self, module: int, fault: UnitFault) -> None:
        """Break ``module`` (0 to 3) from the next tick on; ``UnitFault.NONE`` mends it."""


class FaultyPlant:
    """A plant around another one, which it leaves alone as long as no fault is injected.

    Args:
        plant: the simulated robot.
        faults: what can be injected into it, by name.
        unit: what breaks of its tension-feedback unit; None without one.

    Attributes:
        spec: of the wrapped plant.
        faults: the same.
        active: name of the fault that acts now; empty for none.
    """

    def __init__(
        self,
        plant: Plant,
        faults: Mapping[str, PlantFault] = FAULTS,
        unit: BreakableUnit | None = None,
    ) -> None:
        self._plant, self.faults, self._unit = plant, faults, unit
        self.spec: PlantSpec = plant.spec
        self.active = ""
        self._fault: PlantFault | None = None
        measured = plant.read()
        self._q, self._servo = measured.q.copy(), measured.servo.copy()
        self._held_q, self._held_servo = self._q.copy(), self._servo.copy()
        self._tracker = measured.tracker.copy()
        self._command: np.ndarray | None = None
        self._age_s, self._late_s = 0.0, 0.0

    def inject(self, name: str) -> None:
        """Break it from the next tick on; the fault that acted before is over.

        Raises:
            UnknownName: there is no such fault.
        """
        if name not in self.faults:
            raise UnknownName("fault", name, tuple(self.faults))
        self.clear()
        measured = self._plant.read()
        self._held_q[:], self._held_servo[:] = measured.q, measured.servo
        self.active, fault = name, self.faults[name]
        self._fault = fault
        if self._unit is not None and fault.module != _NOBODY:
            self._unit.break_module(fault.module, fault.unit)
        self._age_s, self._late_s = 0.0, fault.late_s
        self._tracker = measured.tracker.copy()

    def clear(self) -> None:
        """Mend it."""
        fault = self._fault
        self.active, self._fault = "", None
        if self._unit is not None and fault is not None and fault.module != _NOBODY:
            self._unit.break_module(fault.module, UnitFault.NONE)

    def read(self) -> Measurement:
        """The newest measurement, as the fault leaves it."""
        measured = self._plant.read()
        fault = self._fault
        if fault is None:
            return measured
        if fault.fails:
            raise PlantBroke(f"injected: {fault.title}")
        self._q[:] = self._held_q if fault.silent else measured.q
        self._servo[:] = self._held_servo if fault.silent else measured.servo
        if fault.offset_joint != _NOBODY:
            self._q[fault.offset_joint] += fault.offset_rad
        return measured._replace(
            q=self._q,
            servo=self._servo,
            tracker=self._lost_tracker() if fault.tracker_lost else measured.tracker,
            valid=measured.valid and fault.valid,
            age_s=max(measured.age_s, self._age_s) if fault.silent else measured.age_s,
            contact_n=measured.contact_n + fault.contact_n,
            event=int(fault.event) or measured.event,
            readiness=int(fault.readiness) or measured.readiness,
        )

    def _lost_tracker(self) -> np.ndarray:
        lost = self._tracker.copy()
        lost["age_s"] += self._age_s
        return lost

    def write(self, command: np.ndarray) -> None:
        """Pass the command on, except what is stuck."""
        fault = self._fault
        if fault is None or (fault.stuck_joint == _NOBODY and fault.stuck_servo == _NOBODY):
            self._plant.write(command)
            return
        if self._command is None:
            self._command = command.copy()
        self._command[:] = command
        if fault.stuck_joint != _NOBODY:
            self._command["q"][0, fault.stuck_joint] = self._held_q[fault.stuck_joint]
        if fault.stuck_servo != _NOBODY:
            self._command["servo"][0, fault.stuck_servo] = self._held_servo[fault.stuck_servo]
        self._plant.write(self._command)

    def advance(self) -> int:
        """Let one tick pass; a late one takes its time."""
        if self._fault is not None:
            late_s, self._late_s = self._late_s, 0.0
            if late_s > 0.0:
                time.sleep(late_s)
            self._age_s += self.spec.tick_ns * 1e-9
        return self._plant.advance()

    def truth(self, truth: np.ndarray) -> bool:
        """The wrapped plant's truth, or one that nobody can draw."""
        known = self._plant.truth(truth)
        if self._fault is not None and self._fault.shows_nothing:
            truth["position"], truth["wxyz"] = math.nan, math.nan
        return known

    def hold(self) -> None:
        """Stay where it is, under torque."""
        self._plant.hold()

    def release(self) -> None:
        """Let go of torque."""
        self._plant.release()

    def take_hold(self) -> None:
        """Put torque on."""
        self._plant.take_hold()

    def home(self) -> None:
        """Find the tendons' zero."""
        self._plant.home()

    def reboot(self) -> None:
        """Start devices anew."""
        self._plant.reboot()

    def fill_devices(self, devices: np.ndarray) -> None:
        """What the wrapped plant tells of its devices, (1,) ``hardware.devices.DEVICES``."""
        self._plant.fill_devices(devices)

    def close(self) -> None:
        """Give the devices back."""
        self._plant.close()

    def change_board(self, board: Board) -> None:
        """Put another board before the instrument."""
        self._plant.change_board(board)

    def register_trocar(self, position: np.ndarray) -> None:
        """The trocar is registered now, (3,), base frame, m."""
        self._plant.register_trocar(position)
