"""Tendons that hold tensions on the physics plant: what they carry, and how soft the bend is."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from hardware.physics.plant import PhysicsPlant
from hardware.tension_unit.module import UnitFault
from robot.calibration import Calibration
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import Request, Safety
from robot.safety import Event
from robot.tension.feasibility import CONTROL_NAMES
from robot.tension.records import TendonMode
from scenes.boards.board import Board
from server.calibration.sweep import calibration_for
from server.configuration_file import load
from server.control.instrument_loop import InstrumentLoop

LEVEL = 3.0
"""Co-contraction, N."""


@cache
def configuration() -> Configuration:
    under = load()
    unit = under.simulation.model_copy(update={"actuation": "tension-unit", "board": "none"})
    return under.model_copy(update={"simulation": unit})


@cache
def calibration() -> Calibration:
    return calibration_for(configuration())


class Rig:
    """The loop of the instrument on the physics plant with the unit, enabled at the start."""

    def __init__(self, control: str, friction: bool = True) -> None:
        robot = InstrumentRobot(configuration(), calibration())
        x = robot.initial_state()["x"][0]
        self.plant = PhysicsPlant(configuration(), x, Board("none", "No board"))
        if not friction:
            self.plant._constants["friction"] = 0.0
        self.loop = InstrumentLoop(robot, self.plant, configuration())
        self.loop.hold = 1
        self.hold(control)
        self.step(100)
        self.plant.register_trocar(self.loop.trocar_position)
        self.loop.request = Request.ENABLE
        self.step(1)

    def hold(self, control: str, level: float = LEVEL) -> None:
        self.loop.settings["tendon_control"] = CONTROL_NAMES[control]
        self.loop.settings["co_contraction"] = level

    def step(self, ticks: int) -> None:
        for _ in range(ticks):
            self.loop.step()

    @property
    def record(self) -> Any:
        return self.loop.record[0]

    @property
    def bend(self) -> np.ndarray:
        return np.array(self.record["truth"]["uv"])

    def push(self, newtons: float) -> None:
        """Across the tip, in the plane of its bend; it stays there."""
        model, data, physics = self.plant._model, self.plant._data, self.plant._physics
        body = model.site_bodyid[physics.tip_site]
        force = newtons * data.site_xmat[physics.tip_site].reshape(3, 3)[:, 0]
        lever = data.site_xpos[physics.tip_site] - data.xipos[body]
        data.xfrc_applied[body] = [*force, *np.cross(lever, force)]


@pytest.mark.parametrize("control", ["hybrid", "tension"])
def test_no_tendon_falls_below_the_co_contraction(control: str) -> None:
    rig = Rig(control)
    rig.step(400)
    tensions = []
    for _ in range(400):
        rig.step(1)
        tensions.append(rig.record["truth"]["tension"].copy())
    assert rig.loop.safety == Safety.ENABLED
    modes = rig.record["outcome"]["command"]["tendon_mode"]
    told = rig.record["outcome"]["command"]["tension"]
    held = modes == TendonMode.TENSION
    assert held.sum() == (2 if control == "hybrid" else 4)
    mean = np.mean(tensions, axis=0)
    np.testing.assert_allclose(mean[held], told[held], atol=0.1)
    assert np.min(tensions) > LEVEL - 0.2
    # The bend is where it was before, but for the friction that tightening changes.
    assert rig.bend == pytest.approx(rig.record["outcome"]["state"]["x"][7:9], abs=0.02)


def test_held_tensions_make_the_bend_soft() -> None:
    """How far a push moves it: a length on either side of it, on one side, on none."""

    def given(control: str) -> float:
        rig = Rig(control, friction=False)
        rig.step(400)
        found = []
        for newtons in (0.01, -0.01):
            for _ in range(400):
                rig.push(newtons)
                rig.step(1)
            found.append(float(rig.bend[0]))
        return abs(found[1] - found[0])

    lengths, hybrid, tensions = (given(control) for control in CONTROL_NAMES)
    assert 1.3 * lengths < hybrid < 2.2 * lengths
    assert tensions > 8.0 * lengths


def test_switching_to_and_fro_bends_a_resting_robot_hardly() -> None:
    rig = Rig("position")
    rig.step(200)
    before = rig.bend
    for control in ("hybrid", "position", "tension", "hybrid", "tension", "position"):
        rig.hold(control)
        rig.step(250)
        assert np.degrees(np.abs(rig.bend - before)).max() < 0.6, control
    assert rig.loop.safety == Safety.ENABLED


def test_a_tendon_that_breaks_while_it_holds_tension_is_stopped() -> None:
    """Its motor winds up what nothing loads, until that is too far from its length."""
    rig = Rig("hybrid")
    rig.step(400)
    loose = int(np.flatnonzero(rig.record["outcome"]["command"]["tendon_mode"])[0])
    rig.plant.break_module(loose, UnitFault.TENDON_BROKEN)
    for _ in range(1500):
        rig.loop.step()
        if rig.loop.safety != Safety.ENABLED:
            break
    assert rig.loop.safety == Safety.FAULT
    assert rig.record["outcome"]["state"]["reason"] == Event.TENDON_RUNS
    wound = rig.record["input"]["measured_servo"].copy()
    rig.step(200)
    still = rig.record["input"]["measured_servo"]
    assert abs(still[loose] - wound[loose]) * 5.4 < 0.5
