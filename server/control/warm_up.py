"""Run every branch of the tick once before real time begins, so that nothing compiles later."""

from __future__ import annotations

import itertools

import numpy as np

from hardware.kinematic_plant import KinematicPlant
from hardware.tube_plant import TubePlant
from robot.concentric.concentric_robot import ConcentricRobot
from robot.concentric.design import METHODS
from robot.concentric.stability_slope import stability_slope
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import Case, Coordinates, LeaderKind, Request, Solver
from scenes.path import Path
from server.control.concentric_loop import ConcentricLoop
from server.control.instrument_loop import InstrumentLoop
from server.control.loop import ControlLoop

_TICKS_EACH = 3
_STEP_M = 2e-5


def warm_up(robot: InstrumentRobot, configuration: Configuration) -> None:
    """Drive a throw-away plant and loop through every solver, leader and safety state.

    Args:
        robot: the robot whose functions are compiled; it is left as it was.
        configuration: what it was built from.
    """
    plant = KinematicPlant(configuration, robot.initial_state()["x"][0])
    loop = InstrumentLoop(robot, plant, configuration)
    # Also where it is off at first: it may be switched on while the robot moves.
    loop.settings["sensing"] = 1
    _request(loop, Request.ENABLE)
    loop.leader["timeout_s"] = 1.0
    loop.leader["wxyz"][0] = (1.0, 0.0, 0.0, 0.0)
    loop.leader["smoothing_s"] = 0.05
    for kind in (LeaderKind.GIZMO, LeaderKind.API_TARGET):
        loop.leader["kind"], loop.leader["clutch"] = kind, 1
        loop.leader["absolute"] = int(kind == LeaderKind.API_TARGET)
        if kind == LeaderKind.API_TARGET:
            loop.leader["position"] = loop.record["outcome"]["report"]["commanded_position"]
            loop.leader["wxyz"] = loop.record["outcome"]["report"]["commanded_wxyz"]
        _every_setting(loop)
        loop.leader["clutch"] = 0
        loop.step()
    _play(loop)
    _request(loop, Request.PAUSE)
    _request(loop, Request.EMERGENCY_STOP)
    _request(loop, Request.RESET)
    plant.close()


def warm_up_tubes(robot: ConcentricRobot) -> None:
    """The same for the concentric-tube arms; ``robot`` is left as it was."""
    plant = TubePlant(robot.configuration, robot.initial_state()["q"][0])
    loop = ConcentricLoop(robot, plant, robot.configuration)
    _request(loop, Request.ENABLE)
    loop.leader["timeout_s"], loop.leader["smoothing_s"] = 1.0, 0.05
    loop.leader["wxyz"][0] = (1.0, 0.0, 0.0, 0.0)
    loop.leader["kind"], loop.leader["clutch"] = LeaderKind.GIZMO, 1
    for method in range(len(METHODS)):
        loop.settings["method"] = method
        for _ in range(_TICKS_EACH):
            loop.leader["sequence"] += 1
            loop.leader["position"][0, 0] += _STEP_M
            loop.step()
    loop.leader["clutch"] = 0
    loop.step()
    _play(loop)
    _request(loop, Request.PAUSE)
    _request(loop, Request.EMERGENCY_STOP)
    _request(loop, Request.RESET)
    plant.close()
    _come_near_snapping(robot)


def _come_near_snapping(robot: ConcentricRobot) -> None:
    """What is only computed near snapping, which the start is not."""
    state, pair = robot.initial_state()[0], robot.pair
    n, q, torsion = pair.count, state["q"], state["torsion"]
    change, slope = np.zeros((n, 2 * n)), np.zeros(2 * n)
    stability_slope(q[: 2 * n].copy(), torsion[:n].copy(), change, pair.tubes, slope)


def _request(loop: ControlLoop, request: Request) -> None:
    loop.request = request
    loop.step()


def _every_setting(loop: InstrumentLoop) -> None:
    for case, solver, coordinates in itertools.product(Case, Solver, Coordinates):
        loop.settings["case"], loop.settings["solver"] = case, solver
        loop.settings["coordinates"] = coordinates
        for _ in range(_TICKS_EACH):
            loop.leader["sequence"] += 1
            loop.leader["position"][0, 0] += _STEP_M
            loop.step()


def _play(loop: ControlLoop) -> None:
    samples = np.zeros((3, 8))
    samples[:, 0] = (0.0, 0.1, 0.2)
    samples[:, 1] = (0.0, 0.001, 0.0)
    samples[:, 4] = 1.0
    loop.start_path(Path(samples, "warm-up"))
    for _ in range(_TICKS_EACH):
        loop.step()
    loop.stop_path()
