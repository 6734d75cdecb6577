"""The arm posture in which the robot wakes up: inverse kinematics of the start, once."""

from __future__ import annotations

import math

import numpy as np

from robot.arm import Arm
from robot.configuration import Configuration
from robot.errors import UnreachableStart
from robot.rotations import logarithm
from robot.segment import tip_rotation

_SEEDS = 48
_ITERATIONS = 60
_POSTURE_STEPS = 200
_POSTURE_STEP = 0.05
_POSITION_TOLERANCE = 1e-12


def start_shaft_rotation(configuration: Configuration) -> np.ndarray:
    """The segment's base frame (3, 3) at the start: z along the shaft, x as near "up" as can be."""
    z = np.array(configuration.start.shaft_direction)
    z /= np.linalg.norm(z)
    up = np.array(configuration.start.bend_direction_up)
    x = up - (up @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def start_bend(configuration: Configuration) -> tuple[float, float]:
    """(u, v) of the start in rad."""
    bend = math.radians(configuration.start.bend_deg)
    direction = math.radians(configuration.start.direction_deg)
    return bend * math.cos(direction), bend * math.sin(direction)


def start_tip_rotation(configuration: Configuration) -> np.ndarray:
    """The tip frame (3, 3) at the start, in the base frame."""
    local = np.empty((3, 3))
    tip_rotation(*start_bend(configuration), local)
    return start_shaft_rotation(configuration) @ local


def _start_flange(
    configuration: Configuration, parameters: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and rotation (3, 3) of the flange that put the shaft where the start asks."""
    p = parameters[0]
    shaft = start_shaft_rotation(configuration)
    rotation = shaft @ p["rotation_flange_segment"].T
    trocar = np.array(configuration.trocar.position_m)
    base = trocar - configuration.start.lambda_along_shaft * p["shaft_length"] * shaft[:, 2]
    return base - rotation @ p["shaft_base"], rotation


def _residual(arm: Arm, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    turn = np.empty(3)
    logarithm(rotation @ arm.rotation.T, turn)
    return np.concatenate([position - arm.position, turn])


def _flange_jacobian(arm: Arm) -> np.ndarray:
    jacobian = arm.jacobian.copy()
    jacobian[:3] += np.cross(jacobian[3:].T, arm.position).T
    return jacobian


def _solve(
    arm: Arm,
    q: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Damped Newton from ``q`` inside the limits; the angles and the residual (6,)."""
    for _ in range(_ITERATIONS):
        arm.update(q)
        residual = _residual(arm, position, rotation)
        if residual @ residual < _POSITION_TOLERANCE**2:
            break
        jacobian = _flange_jacobian(arm)
        damping = 1e-2 * min(1.0, float(residual @ residual))
        step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping * np.eye(6), residual)
        largest = float(np.abs(step).max())
        q = np.clip(q + step * min(1.0, 0.5 / max(largest, 1e-12)), lower, upper)
    arm.update(q)
    return q, _residual(arm, position, rotation)


def posture_cost(q: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """Squared distance from the middle of the joint ranges, each range counting as one."""
    return float(np.sum(((q - 0.5 * (lower + upper)) / (upper - lower)) ** 2))


def _relax(arm: Arm, q: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Slide along the arm's self-motion to where it is nearest the middle of the joint ranges."""
    middle, reach = 0.5 * (lower + upper), upper - lower
    for _ in range(_POSTURE_STEPS):
        arm.update(q)
        null = np.linalg.svd(_flange_jacobian(arm))[2][6]
        step = float(null @ ((q - middle) / reach**2)) / float(null @ (null / reach**2))
        q = np.clip(q - min(max(0.5 * step, -_POSTURE_STEP), _POSTURE_STEP) * null, lower, upper)
    return q


def start_configuration(
    configuration: Configuration, arm: Arm, parameters: np.ndarray
) -> np.ndarray:
    """The augmented configuration x (10,) of the start.

    Of all solutions found from fixed seeds, the one nearest the middle of the joint ranges.

    Raises:
        UnreachableStart: no posture inside the limits puts the shaft through the trocar.
    """
    p = parameters[0]
    lower, upper = p["joint_lower"], p["joint_upper"]
    position, rotation = _start_flange(configuration, parameters)
    generator = np.random.default_rng(20)
    low, high = np.maximum(lower, -math.pi), np.minimum(upper, math.pi)
    best: np.ndarray | None = None
    best_cost, nearest = math.inf, np.full(6, math.inf)
    for _ in range(_SEEDS):
        q, residual = _solve(arm, generator.uniform(low, high), position, rotation, lower, upper)
        size = float(residual @ residual)
        if size < float(nearest @ nearest):
            nearest = residual
        if size > 1e-16:
            continue
        q, residual = _solve(arm, _relax(arm, q, lower, upper), position, rotation, lower, upper)
        cost = posture_cost(q, lower, upper)
        if residual @ residual < 1e-16 and cost < best_cost:
            best, best_cost = q, cost
    if best is None:
        raise UnreachableStart(
            float(np.linalg.norm(nearest[:3])), float(np.linalg.norm(nearest[3:]))
        )
    u, v = start_bend(configuration)
    return np.array([*best, u, v, configuration.start.lambda_along_shaft])
