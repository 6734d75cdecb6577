"""A physics robot for the tests: built as asked, moved by its servos, and looked at."""

from __future__ import annotations

import functools
import math

import numpy as np
from scipy.spatial.transform import Rotation

from hardware.physics.plant import PhysicsPlant
from hardware.plant import Plant
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import COMMAND, TRUTH
from scenes.boards.board import Board, Ring
from scenes.boards.solids import fixed, plate, rotation_to
from server.configuration_file import load
from tests import own_kinematics

DT = 0.002
NO_BOARD = Board("none", "No board")
TICK = 2.0 * math.pi / 4096


@functools.cache
def configuration(preset: str = "paper", seed: int = 1) -> Configuration:
    """The one that comes along, with another robot."""
    under = load()
    chosen = {"preset": preset, "seed": seed, "plant": "physics", "board": "none"}
    return under.model_copy(update={"simulation": under.simulation.model_copy(update=chosen)})


@functools.cache
def start() -> np.ndarray:
    """(10,) the configured start."""
    return np.array(InstrumentRobot(configuration()).initial_state()["x"][0])


def standing_straight() -> np.ndarray:
    """(10,) the start, with a straight segment."""
    return np.array([*start()[:7], 0.0, 0.0, start()[9]])


def physics(
    preset: str = "paper",
    seed: int = 1,
    board: Board = NO_BOARD,
    x: np.ndarray | None = None,
) -> PhysicsPlant:
    """A robot at the start, or at ``x`` (10,)."""
    return PhysicsPlant(configuration(preset, seed), start() if x is None else x, board)


def obstacle(ring: bool = False) -> Board:
    """A plate on the way of a tip that bends further than at the start; if asked, a ring's part."""
    x = start().copy()
    away = own_kinematics.pose_at(configuration(), x).tip
    x[7:9] *= 1.4
    place = own_kinematics.pose_at(configuration(), x).tip
    normal = (away - place) / np.linalg.norm(away - place)
    solid = plate("in the way", place, (0.006, 0.006), 0.004, rotation_to(normal), (0, 0, 0))
    rings = (Ring(fixed(place), fixed([1.0, 0.0, 0.0]), 0.004, (0,)),) if ring else ()
    return Board("in the way", "In the way", (solid,), rings)


def servos(u: float, v: float) -> np.ndarray:
    """(4,) servo angles of a bend: 1.8 mm of pitch radius over 5.4 mm of pulley."""
    return np.array([-u, v, u, -v]) / 3.0


def command(q: np.ndarray, servo: np.ndarray) -> np.ndarray:
    """A (1,) command."""
    one = np.zeros(1, COMMAND)
    one["q"], one["servo"], one["moving"] = q, servo, 1
    return one


def wait(plant: Plant, seconds: float) -> None:
    """Let time pass without commands."""
    for _ in range(round(seconds / DT)):
        plant.advance()


def bend(plant: Plant, u: float, v: float, seconds: float = 1.0, rest: float = 0.4) -> None:
    """Turn the servos evenly to a bend, the joints where they are told to be, and rest."""
    before, goal = plant.read().servo.copy(), servos(u, v)
    count = round(seconds / DT)
    for index in range(1, count + 1):
        plant.write(command(start()[:7], before + (goal - before) * index / count))
        plant.advance()
    wait(plant, rest)


def truth(plant: Plant) -> np.void:
    """What the plant knows of itself; the trocar is told to be where it is configured."""
    record = np.zeros(1, TRUTH)
    record["trocar_position"] = configuration().trocar.position_m
    assert plant.truth(record)
    found: np.void = record[0]
    return found


def bend_deg(plant: Plant) -> np.ndarray:
    """(2,) true (u, v) in degrees."""
    found: np.ndarray = np.degrees(truth(plant)["uv"])
    return found


def expected(found: np.void) -> own_kinematics.Pose:
    """Where everything is by the drawings, at the true joints and bend."""
    return own_kinematics.pose_at(configuration(), np.array([*found["q"], *found["uv"], 0.0]))


def rotation(wxyz: np.ndarray) -> np.ndarray:
    """(3, 3) of a quaternion (4,)."""
    return np.asarray(Rotation.from_quat(np.asarray(wxyz)[[1, 2, 3, 0]]).as_matrix())
