"""A section in which at most one tube is curved: nothing twists, and the backbone is a helix.

In the frame of the curved tube the bending (κ, 0) and the torsion ω are constant, so that frame is
a matrix exponential. Its derivative needs no more: a change of ω turns the tube's frame about the
tangent t everywhere, by ∫ t ds = the chord, with the moment ∫ p × t ds.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.concentric.state import ArmState
from robot.concentric.vectors import Triple, add_to_column, column, combine, cross

SERIES = 0.1
"""Below this turn (rad) the coefficients come from their Taylor series; at it, the neglected terms
are below 1e-14."""


@compiled
def _coefficients(turn: float) -> tuple[float, float, float, float, float]:
    """Of a turn x: sin x / x, (1 − cos x) / x², (x − sin x) / x³, (x + x cos x − 2 sin x) / x³,
    (x sin x − 2 + 2 cos x) / x⁴.
    """
    square = turn * turn
    if turn < SERIES:
        return (
            1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)),
            0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)),
            1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)),
            -1.0 / 6.0 + square / 40.0 - square * square / 1008.0 + square**3 / 51840.0,
            -1.0 / 12.0 + square / 180.0 - square * square / 6720.0 + square**3 / 453600.0,
        )
    sine, cosine = math.sin(turn), math.cos(turn)
    return (
        sine / turn,
        (1.0 - cosine) / square,
        (turn - sine) / (turn * square),
        (turn + turn * cosine - 2.0 * sine) / (turn * square),
        (turn * sine - 2.0 + 2.0 * cosine) / (square * square),
    )


@compiled
def _twist_on(state: ArmState, length: float, first: int) -> None:
    """Every tube's angle goes on at its own rate over ``length`` (m)."""
    for index in range(len(state.angle)):
        state.angle[index] += length * state.rate[index]
        for parameter in range(first, state.turn.shape[1]):
            change = length * state.rate_change[index, parameter]
            state.angle_change[index, parameter] += change


@compiled
def _rotate(rotation: np.ndarray, bend: Triple, length: float, own: float) -> None:
    """Turn ``rotation`` by exp(length [bend]) from the left and by −``own`` about its own z."""
    sinc, versine, _, _, _ = _coefficients(length * math.sqrt(_square(bend)))
    for index in range(3):
        once = cross(bend, column(rotation, index))
        twice = cross(bend, once)
        add_to_column(rotation, index, length * sinc, once)
        add_to_column(rotation, index, length * length * versine, twice)
    cosine, sine = math.cos(own), math.sin(own)
    for row in range(3):
        x, y = rotation[row, 0], rotation[row, 1]
        rotation[row, 0], rotation[row, 1] = cosine * x - sine * y, sine * x + cosine * y


@compiled
def _square(vector: Triple) -> float:
    return vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]


@compiled
def _chord_and_area(bend: Triple, tangent: Triple, length: float) -> tuple[Triple, Triple]:
    """Of a helix that starts at the origin: ∫ t ds (m) and ∫ p × t ds (m²).

    The second from the parts of t along the helix's axis and beside it.
    """
    square = _square(bend)
    rate = bend[0] * tangent[0] + bend[1] * tangent[1] + bend[2] * tangent[2]
    _, versine, cubic, fourth, fifth = _coefficients(length * math.sqrt(square))
    once = cross(bend, tangent)
    twice = cross(bend, once)
    swing = combine(versine, once, length * cubic, twice)
    chord = combine(length, tangent, length * length, swing)
    cube = length**3 / square
    along = combine(cube * _square(once) * cubic, bend, -cube * rate * fourth, twice)
    return chord, combine(1.0, along, length**4 * rate * fifth, once)


@compiled
def advance_helix(state: ArmState, length: float, first: int, with_shape: bool) -> None:
    """Advance over a section in which at most one tube is curved.

    Args:
        state: of the arm, advanced in place.
        length: of the section, m.
        first: derivatives by the parameters from this one on are carried along.
        with_shape: whether position and rotation (and their derivatives) are carried along.
    """
    curved = -1
    for index in range(len(state.share)):
        if state.share[index] != 0.0:
            curved = index
    tangent = column(state.rotation, 2)
    if not with_shape:
        _twist_on(state, length, first)
        return
    if curved < 0:
        _twist_on(state, length, first)
        for row in range(3):
            state.position[row] += length * tangent[row]
        return
    kappa, rate, angle = state.share[curved], state.rate[curved], state.angle[curved]
    normal = combine(
        math.cos(angle), column(state.rotation, 0), math.sin(angle), column(state.rotation, 1)
    )
    bend = combine(kappa, normal, rate, tangent)
    chord, area = _chord_and_area(bend, tangent, length)
    start = (state.position[0], state.position[1], state.position[2])
    moment = combine(1.0, cross(start, chord), 1.0, area)
    _carry_turn(state, curved, 1.0, first)
    for parameter in range(first, state.turn.shape[1]):
        change = state.rate_change[curved, parameter]
        add_to_column(state.turn, parameter, change, chord)
        add_to_column(state.moment, parameter, change, moment)
    for row in range(3):
        state.position[row] += chord[row]
    _rotate(state.rotation, bend, length, rate * length)
    _twist_on(state, length, first)
    _carry_turn(state, curved, -1.0, first)


@compiled
def _carry_turn(state: ArmState, curved: int, sign: float, first: int) -> None:
    """From the Bishop frame's turn to that of the tube ``curved`` (sign 1), or back (sign −1)."""
    tangent = column(state.rotation, 2)
    moment = cross((state.position[0], state.position[1], state.position[2]), tangent)
    for parameter in range(first, state.turn.shape[1]):
        change = sign * state.angle_change[curved, parameter]
        add_to_column(state.turn, parameter, change, tangent)
        add_to_column(state.moment, parameter, change, moment)
