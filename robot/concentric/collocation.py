"""A section in which several tubes are curved: they twist each other, and no closed form remains.

It is integrated in equal steps by collocation at Gauss points (a Runge–Kutta method whose order is
twice the number of points, Hairer, Nørsett & Wanner 1993, II.7). It keeps the frame orthonormal,
and it integrates the derivatives so that they are those of the integrated angles. The equations at
the points are solved by iteration, which gains a factor of the turn of one step each time.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.concentric.state import ArmState
from robot.concentric.vectors import add_to_column, column, combine, cross

POINTS = 4

STEP_TURN = 0.6
"""Longest step, as a phase (rad) of the fastest motion that tubes can make in the section. With
four points the tip is then within 1e-9 mm of where ten times finer steps have it."""

_SETTLED = 1e-14
_MOST_ITERATIONS = 40


def _gauss(points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of Gauss's points in [0, 1]: places c (m,), weights b (m,), and the (m, m) integrals from 0
    to c_i of the polynomial that is 1 at c_j and 0 at the others.
    """
    nodes, weights = np.polynomial.legendre.leggauss(points)
    places = 0.5 * (nodes + 1.0)
    powers = np.arange(1, points + 1)
    integrals = places[:, None] ** powers / powers
    values = places[:, None] ** (powers - 1)
    return places, 0.5 * weights, integrals @ np.linalg.inv(values)


_PLACES, _WEIGHTS, _INTEGRALS = _gauss(POINTS)
_TWICE = _INTEGRALS @ _INTEGRALS
_WEIGHTS_TWICE = _WEIGHTS @ _INTEGRALS


@compiled
def _step_count(state: ArmState, length: float) -> int:
    """Enough steps for the tubes' torsional waves and the backbone's bending over ``length`` (m).

    No torsion rate of a solution exceeds about twice the frequency of the waves: the energy of its
    twist comes from the bending that the tubes give up.
    """
    bend = stiffest = 0.0
    for index in range(len(state.share)):
        bend += state.share[index]
        stiffest = max(stiffest, state.gain[index])
    fastest = math.sqrt(stiffest * bend) + bend
    return 1 + int(length * fastest / STEP_TURN)


@compiled
def _angles_at_points(state: ArmState, step: float) -> tuple[np.ndarray, ...]:
    """At the points of a step: cos ψ and sin ψ (m, n), bending (m, 2) in 1/m, ψ'' (m, n)."""
    count = len(state.angle)
    cosines, sines = np.zeros((POINTS, count)), np.zeros((POINTS, count))
    bend, pull = np.empty((POINTS, 2)), np.zeros((POINTS, count))
    for _ in range(_MOST_ITERATIONS):
        worst = 0.0
        for point in range(POINTS):
            x = y = 0.0
            for index in range(count):
                if state.share[index] == 0.0:
                    continue
                angle = state.angle[index] + _PLACES[point] * step * state.rate[index]
                for other in range(POINTS):
                    angle += step * step * _TWICE[point, other] * pull[other, index]
                cosines[point, index] = math.cos(angle)
                sines[point, index] = math.sin(angle)
                x += state.share[index] * cosines[point, index]
                y += state.share[index] * sines[point, index]
            bend[point, 0], bend[point, 1] = x, y
            for index in range(count):
                value = state.gain[index] * (sines[point, index] * x - cosines[point, index] * y)
                worst = max(worst, step * step * abs(value - pull[point, index]))
                pull[point, index] = value
        if worst < _SETTLED:
            break
    return cosines, sines, bend, pull


@compiled
def _frames_at_points(rotation: np.ndarray, bend: np.ndarray, step: float) -> np.ndarray:
    """(m + 1, 3, 3) Bishop frames at the points of a step and at its end."""
    frames = np.empty((POINTS + 1, 3, 3))
    slopes = np.empty((POINTS, 3, 3))
    for point in range(POINTS + 1):
        for row in range(3):
            for axis in range(3):
                frames[point, row, axis] = rotation[row, axis]
    for _ in range(_MOST_ITERATIONS):
        for point in range(POINTS):
            x, y = bend[point, 0], bend[point, 1]
            for row in range(3):
                slopes[point, row, 0] = -y * frames[point, row, 2]
                slopes[point, row, 1] = x * frames[point, row, 2]
                slopes[point, row, 2] = y * frames[point, row, 0] - x * frames[point, row, 1]
        worst = 0.0
        for point in range(POINTS + 1):
            for row in range(3):
                for axis in range(3):
                    value = rotation[row, axis]
                    for other in range(POINTS):
                        weight = _WEIGHTS[other]
                        if point < POINTS:
                            weight = _INTEGRALS[point, other]
                        value += step * weight * slopes[other, row, axis]
                    worst = max(worst, abs(value - frames[point, row, axis]))
                    frames[point, row, axis] = value
        if worst < _SETTLED:
            break
    return frames


@compiled
def _changes_at_points(
    state: ArmState,
    step: float,
    parameter: int,
    points: tuple[np.ndarray, ...],
    angles: np.ndarray,
    pulls: np.ndarray,
) -> None:
    """Derivatives of ψ and ψ'' at the points of a step by one parameter.

    Args:
        state: at the beginning of the step.
        step: m.
        parameter: its column.
        points: what :func:`_angles_at_points` found.
        angles: (m, n) filled.
        pulls: (m, n) filled; zero where no tube is curved.
    """
    cosines, sines, bend, _ = points
    count = len(state.angle)
    pulls.fill(0.0)
    for _ in range(_MOST_ITERATIONS):
        worst = size = 0.0
        for point in range(POINTS):
            x = y = 0.0
            for index in range(count):
                if state.share[index] == 0.0:
                    continue
                change = (
                    state.angle_change[index, parameter]
                    + _PLACES[point] * step * state.rate_change[index, parameter]
                )
                for other in range(POINTS):
                    change += step * step * _TWICE[point, other] * pulls[other, index]
                angles[point, index] = change
                size = max(size, abs(change))
                x -= state.share[index] * sines[point, index] * change
                y += state.share[index] * cosines[point, index] * change
            for index in range(count):
                along = (
                    cosines[point, index] * bend[point, 0] + sines[point, index] * bend[point, 1]
                )
                pull = state.gain[index] * (
                    along * angles[point, index]
                    + sines[point, index] * x
                    - cosines[point, index] * y
                )
                worst = max(worst, step * step * abs(pull - pulls[point, index]))
                pulls[point, index] = pull
        if worst <= _SETTLED * size:
            break


@compiled
def _turn_by_bending(
    state: ArmState,
    step: float,
    parameter: int,
    points: tuple[np.ndarray, ...],
    angles: np.ndarray,
    frames: np.ndarray,
    positions: np.ndarray,
) -> None:
    """Add what the change of bending over a step does to ``turn`` and ``moment``."""
    for point in range(POINTS):
        x = y = 0.0
        for index in range(len(state.angle)):
            x -= state.share[index] * points[1][point, index] * angles[point, index]
            y += state.share[index] * points[0][point, index] * angles[point, index]
        frame = frames[point]
        place = (positions[point, 0], positions[point, 1], positions[point, 2])
        turn = combine(x, column(frame, 0), y, column(frame, 1))
        add_to_column(state.turn, parameter, step * _WEIGHTS[point], turn)
        add_to_column(state.moment, parameter, step * _WEIGHTS[point], cross(place, turn))


@compiled
def _positions_at_points(position: np.ndarray, frames: np.ndarray, step: float) -> np.ndarray:
    """(m + 1, 3) places in m at the points of a step and at its end."""
    positions = np.empty((POINTS + 1, 3))
    for row in range(3):
        for point in range(POINTS + 1):
            positions[point, row] = position[row]
            for other in range(POINTS):
                weight = _WEIGHTS[other] if point == POINTS else _INTEGRALS[point, other]
                positions[point, row] += step * weight * frames[other, row, 2]
    return positions


@compiled
def _advance_step(state: ArmState, step: float, first: int, with_shape: bool) -> None:
    count = len(state.angle)
    points = _angles_at_points(state, step)
    if with_shape:
        frames = _frames_at_points(state.rotation, points[2], step)
        positions = _positions_at_points(state.position, frames, step)
    else:
        frames, positions = np.empty((0, 3, 3)), np.empty((0, 3))
    angles, pulls = np.zeros((POINTS, count)), np.zeros((POINTS, count))
    for parameter in range(first, 3 * count):
        _changes_at_points(state, step, parameter, points, angles, pulls)
        if with_shape:
            _turn_by_bending(state, step, parameter, points, angles, frames, positions)
        for index in range(count):
            state.angle_change[index, parameter] += step * state.rate_change[index, parameter]
            for point in range(POINTS):
                pull = pulls[point, index]
                state.angle_change[index, parameter] += step * step * _WEIGHTS_TWICE[point] * pull
                state.rate_change[index, parameter] += step * _WEIGHTS[point] * pull
    for index in range(count):
        state.angle[index] += step * state.rate[index]
        for point in range(POINTS):
            state.angle[index] += step * step * _WEIGHTS_TWICE[point] * points[3][point, index]
            state.rate[index] += step * _WEIGHTS[point] * points[3][point, index]
    if not with_shape:
        return
    for row in range(3):
        state.position[row] = positions[POINTS, row]
        for axis in range(3):
            state.rotation[row, axis] = frames[POINTS, row, axis]


@compiled
def advance_overlap(state: ArmState, length: float, first: int, with_shape: bool) -> None:
    """Advance over a section in which several tubes are curved.

    Args:
        state: of the arm, advanced in place.
        length: of the section, m.
        first: derivatives by the parameters from this one on are carried along.
        with_shape: whether position and rotation (and their derivatives) are carried along.
    """
    steps = _step_count(state, length)
    for _ in range(steps):
        _advance_step(state, length / steps, first, with_shape)
