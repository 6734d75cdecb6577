"""The simulated robot beside its bare engine, and how much faster than real time the loop runs.

Both run in the same process, alternating: a whole tick of controller and plant on an experiment,
and as many steps of the engine alone, on a copy of the same model in the same state. The
difference is what servos, friction, sensors, contacts and the controller cost.
"""

from __future__ import annotations

import time
from typing import Any

import mujoco
import numpy as np

from benchmarks.percentiles import percentiles
from hardware.physics.plant import PhysicsPlant
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import Request
from scenes.boards.board import board
from scenes.experiments import experiment
from server.control.instrument_loop import InstrumentLoop

EXPERIMENTS = ("circle", "silicon-sine", "ring-board")
_WARM_UP = 250
_CHECKED_EVERY = 5
"""Ticks between two turns of the bare engine: copying its state takes longer than a step."""


def _one(configuration: Configuration, name: str, seconds: float) -> dict[str, Any]:
    chosen = experiment(name, configuration)
    robot = InstrumentRobot(configuration)
    x = robot.initial_state()["x"][0]
    plant = PhysicsPlant(configuration, x, board(chosen.board, configuration))
    loop = InstrumentLoop(robot, plant, configuration)
    bare, steps = plant.engine()
    loop.hold = 1
    for _ in range(_WARM_UP):
        loop.step()
    loop.request = Request.ENABLE
    loop.step()
    loop.start_path(chosen.path)
    whole, alone = [], []
    ends = time.perf_counter() + seconds
    while loop.path is not None and time.perf_counter() < ends:
        started = time.perf_counter_ns()
        loop.step()
        whole.append(time.perf_counter_ns() - started)
        if len(whole) % _CHECKED_EVERY:
            continue
        plant.copy_state(bare)
        started = time.perf_counter_ns()
        for _ in range(steps):
            mujoco.mj_step(bare.model, bare)
        alone.append(time.perf_counter_ns() - started)
    dt_ns = plant.spec.tick_ns
    ours, engine = percentiles(whole), percentiles(alone)
    return {
        "tick_us": ours,
        "engine_us": engine,
        "ratio": round(ours["p50"] / engine["p50"], 2),
        "ratio_p99": round(ours["p99"] / engine["p99"], 2),
        "real_time_factor": round(dt_ns / float(np.mean(whole)), 2),
    }


def measure(configuration: Configuration, seconds: float) -> dict[str, Any]:
    """Figures of each experiment.

    Args:
        configuration: preset and seed are taken from it.
        seconds: how long each experiment runs, at most to its end.
    """
    return {
        "rate_hz": configuration.control.rate_hz,
        "preset": configuration.simulation.preset,
        "experiments": {name: _one(configuration, name, seconds) for name in EXPERIMENTS},
    }
