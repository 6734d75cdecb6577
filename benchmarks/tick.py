"""The whole controller tick beside one step of a well-known differential IK library.

Both run in the same process, alternating, so that whatever slows the machine slows both. The peer
is pink: the arm alone, one frame task and a posture task, the same QP solver. Ours is everything:
safety, teleoperation, commands, tip and RCM kinematics, the lexicographic QP with all limits,
integration, forward kinematics.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any
from unittest import mock

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import FrameTask, PostureTask

from benchmarks.percentiles import percentiles
from hardware.kinematic_plant import KinematicPlant
from robot import instrument_robot
from robot.arm import Arm
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.priority.lexicographic import LexicographicProblem
from robot.records import OUTCOME, Request
from robot.urdf import urdf_text
from scenes.experiments import experiment
from server.control.instrument_loop import InstrumentLoop

_WARM_UP = 500


def _recorded_inputs(
    configuration: Configuration, name: str, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """States (n,) and inputs (n,) of the first ticks of an experiment, to feed the tick again."""
    robot = InstrumentRobot(configuration)
    x = robot.initial_state()["x"][0]
    loop = InstrumentLoop(robot, KinematicPlant(configuration, x), configuration)
    loop.request = Request.ENABLE
    loop.step()
    loop.start_path(experiment(name, configuration).path)
    states, inputs = [], []
    for _ in range(count):
        states.append(loop.record["outcome"]["state"].copy())
        loop.step()
        inputs.append(loop.record["input"].copy())
    return np.concatenate(states), np.concatenate(inputs)


class PinkStep:
    """One pink step: frame task on the flange along a circle, posture task, daqp, integration."""

    def __init__(self, configuration: Configuration, q: np.ndarray) -> None:
        """Start at joint angles ``q`` (7,)."""
        model = pin.buildModelFromXML(urdf_text(configuration))
        self._configuration = pink.Configuration(model, model.createData(), q)
        self._dt = 1.0 / configuration.control.rate_hz
        self._frame = FrameTask("flange", position_cost=1.0, orientation_cost=1.0)
        self._frame.set_target_from_configuration(self._configuration)
        self._posture = PostureTask(cost=1e-3)
        self._posture.set_target_from_configuration(self._configuration)
        self._centre = self._frame.transform_target_to_world.translation.copy()
        self._ticks = 0

    def step(self) -> None:
        """Move the target on, solve, integrate."""
        angle = 2.0 * math.pi * self._ticks * self._dt / 20.0
        self._ticks += 1
        self._frame.transform_target_to_world.translation = self._centre + 0.015 * np.array(
            [math.cos(angle) - 1.0, math.sin(angle), 0.0]
        )
        velocity = pink.solve_ik(
            self._configuration, [self._frame, self._posture], self._dt, solver="daqp"
        )
        self._configuration.integrate_inplace(velocity, self._dt)


_OUTERMOST = ("decide_and_prepare", "integrate", "conclude")


def _timed(function: Callable[..., Any], name: str, spent: dict[str, int]) -> Callable[..., Any]:
    def call(*arguments: Any) -> Any:
        began = time.perf_counter_ns()
        result = function(*arguments)
        spent[name] += time.perf_counter_ns() - began
        return result

    return call


def _phase_shares(
    robot: InstrumentRobot, states: np.ndarray, inputs: np.ndarray
) -> dict[str, float]:
    """Share of each phase of the tick, in a run of its own that times them from outside.

    ``decide_and_prepare`` holds safety, teleoperation, commands, tip and RCM kinematics, levels,
    limits, and the motion where all levels can be met; ``qp`` and ``integrate`` are the rest of the
    motion where they cannot; ``arm`` is pinocchio; ``conclude`` is kinematics and report.
    """
    spent = dict.fromkeys([*_OUTERMOST, "qp", "arm", "whole"], 0)
    outcome = np.zeros(1, OUTCOME)
    with ExitStack() as patches:
        for name in _OUTERMOST:
            timed = _timed(getattr(instrument_robot, name), name, spent)
            patches.enter_context(mock.patch.object(instrument_robot, name, timed))
        for owner, name, phase in (
            (LexicographicProblem, "solve", "qp"),
            (Arm, "update", "arm"),
        ):
            timed = _timed(getattr(owner, name), phase, spent)
            patches.enter_context(
                mock.patch.object(owner, name, lambda *rest, timed=timed: timed(*rest))
            )
        tick = _timed(robot.tick, "whole", spent)
        for index in range(len(states)):
            tick(states[index : index + 1], inputs[index : index + 1], outcome)
    whole = spent.pop("whole")
    shares = {name: time_ns / whole for name, time_ns in spent.items()}
    shares["python"] = 1.0 - sum(shares.values())
    return {name: round(share, 3) for name, share in shares.items()}


def _alternate(
    configuration: Configuration, states: np.ndarray, inputs: np.ndarray
) -> tuple[list[int], list[int]]:
    """Times in ns of our ticks and of the peer's steps, turn by turn."""
    robot = InstrumentRobot(configuration)
    outcome = np.zeros(1, OUTCOME)
    peer = PinkStep(configuration, states["x"][0, :7].copy())
    ours: list[int] = []
    theirs: list[int] = []
    for index in range(len(states)):
        state, tick_input = states[index : index + 1], inputs[index : index + 1]
        began = time.perf_counter_ns()
        robot.tick(state, tick_input, outcome)
        between = time.perf_counter_ns()
        peer.step()
        ended = time.perf_counter_ns()
        if index >= _WARM_UP:
            ours.append(between - began)
            theirs.append(ended - between)
    return ours, theirs


def measure(configuration: Configuration, seconds: float) -> dict[str, Any]:
    """Measure.

    Args:
        configuration: of robot and controller.
        seconds: about how long it takes; a pair of tick and step takes about 0.2 ms.

    Returns:
        ``tick_us`` and ``pink_us`` with p50 and p99, ``ratio_p50``, ``phase_share``, ``ticks``; and
        under ``limited`` the same where a limit holds the motion back, so that the QP must decide.
    """
    ticks = min(max(round(seconds / 2e-3), 1000), 9000)
    states, inputs = _recorded_inputs(configuration, "circle", ticks + _WARM_UP)
    ours, theirs = _alternate(configuration, states, inputs)
    document = _figures(ours, theirs)
    robot = InstrumentRobot(configuration)
    document["phase_share"] = _phase_shares(robot, states[_WARM_UP:], inputs[_WARM_UP:])
    document["ticks"] = ticks
    # Between 2.4 s and 5.6 s of this experiment the bend limit is active.
    states, inputs = _recorded_inputs(configuration, "circle-infeasible", 2800)
    states, inputs = states[1200 - _WARM_UP :], inputs[1200 - _WARM_UP :]
    ours, theirs = _alternate(configuration, states, inputs)
    limited = _figures(ours, theirs)
    limited["phase_share"] = _phase_shares(robot, states[_WARM_UP:], inputs[_WARM_UP:])
    document["limited"] = limited
    return document


def _figures(ours: list[int], theirs: list[int]) -> dict[str, Any]:
    tick_us, pink_us = percentiles(ours), percentiles(theirs)
    return {
        "tick_us": tick_us,
        "pink_us": pink_us,
        "ratio_p50": tick_us["p50"] / pink_us["p50"],
    }
