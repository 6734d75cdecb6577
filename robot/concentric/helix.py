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
def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product a × b of two (3,) vectors."""
    return np.array(
        (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    )


@compiled
def _twist_on(state: ArmState, length: float, first: int) -> None:
    """Every tube's angle goes on at its own rate over ``length`` (m)."""
    for index in range(len(state.angle)):
        state.angle[index] += length * state.rate[index]
        for column in range(first, state.turn.shape[1]):
            state.angle_change[index, column] += length * state.rate_change[index, column]


@compiled
def _rotate(rotation: np.ndarray, bend: np.ndarray, length: float, own: float) -> None:
    """Turn ``rotation`` by exp(length [bend]) from the left and by −``own`` about its own z."""
    whole = length * math.sqrt(bend[0] ** 2 + bend[1] ** 2 + bend[2] ** 2)
    sinc, versine, _, _, _ = _coefficients(whole)
    vector = length * bend
    for column in range(3):
        axis = rotation[:, column].copy()
        once = cross(vector, axis)
        twice = cross(vector, once)
        for row in range(3):
            rotation[row, column] = axis[row] + sinc * once[row] + versine * twice[row]
    cosine, sine = math.cos(own), math.sin(own)
    for row in range(3):
        x, y = rotation[row, 0], rotation[row, 1]
        rotation[row, 0], rotation[row, 1] = cosine * x - sine * y, sine * x + cosine * y


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
    if not with_shape or curved < 0:
        if with_shape:
            state.position[:] += length * state.rotation[:, 2]
        _twist_on(state, length, first)
        return
    start, tangent = state.position.copy(), state.rotation[:, 2].copy()
    kappa, rate, angle = state.share[curved], state.rate[curved], state.angle[curved]
    x_axis = math.cos(angle) * state.rotation[:, 0] + math.sin(angle) * state.rotation[:, 1]
    bend = kappa * x_axis + rate * tangent
    square = kappa * kappa + rate * rate
    _, versine, cubic, fourth, fifth = _coefficients(length * math.sqrt(square))
    once = cross(bend, tangent)
    twice = cross(bend, once)
    chord = length * (tangent + length * (versine * once + length * cubic * twice))
    # ∫ (p − start) × t ds, from t's parts along the axis of the helix and beside it.
    area = (
        length**3
        / square
        * (
            kappa * kappa * cubic * bend
            - rate * fourth * twice
            + rate * length * square * fifth * once
        )
    )
    moment = cross(start, chord) + area
    _carry_turn(state, curved, 1.0, first)
    for column in range(first, state.turn.shape[1]):
        change = state.rate_change[curved, column]
        for row in range(3):
            state.turn[row, column] += chord[row] * change
            state.moment[row, column] += moment[row] * change
    state.position[:] += chord
    _rotate(state.rotation, bend, length, rate * length)
    _twist_on(state, length, first)
    _carry_turn(state, curved, -1.0, first)


@compiled
def _carry_turn(state: ArmState, curved: int, sign: float, first: int) -> None:
    """From the Bishop frame's turn to that of the tube ``curved`` (sign 1), or back (sign −1)."""
    tangent = sign * state.rotation[:, 2]
    moment = cross(state.position, tangent)
    for column in range(first, state.turn.shape[1]):
        change = state.angle_change[curved, column]
        for row in range(3):
            state.turn[row, column] += tangent[row] * change
            state.moment[row, column] += moment[row] * change
