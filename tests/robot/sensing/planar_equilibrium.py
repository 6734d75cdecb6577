"""A segment of polynomial curvature at rest, found on its own: no code of ``robot/sensing``.

The equilibrium is where elastic energy minus the work of tendons and tip force is least. Its slopes
are complex steps of formulas written out here, on Simpson's rule.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid, simpson
from scipy.optimize import minimize, root

LENGTH, PITCH_RADIUS, STIFFNESS = 0.030, 0.0018, 1.841e-4
_S = np.linspace(0.0, 1.0, 401)
_AZIMUTHS = 0.5 * math.pi * np.arange(4)
_UNIT = STIFFNESS / LENGTH
"""Energies are counted in it, so that all unknowns and slopes are near 1."""


class Loads(NamedTuple):
    """Tensions (4,) and force (3,) in N, sliding shares (4,) and friction."""

    tensions: np.ndarray
    force: np.ndarray
    sliding: np.ndarray = np.zeros(4)
    friction: float = 0.0
    coulomb: float = 0.0


def curvatures(shape: np.ndarray) -> np.ndarray:
    return np.asarray(shape[0] + shape[1] * _S + shape[2] * _S**2)


def bends(shape: np.ndarray) -> np.ndarray:
    return np.asarray(shape[0] * _S + shape[1] * _S**2 / 2 + shape[2] * _S**3 / 3)


def tip(shape: np.ndarray) -> np.ndarray:
    aside = LENGTH * simpson(np.sin(bends(shape)), x=_S)
    ahead = LENGTH * simpson(np.cos(bends(shape)), x=_S)
    return np.array([aside * np.cos(shape[3]), -aside * np.sin(shape[3]), ahead])


def lengths(shape: np.ndarray) -> np.ndarray:
    return np.asarray(-PITCH_RADIUS * bends(shape)[-1] * np.cos(shape[3] + _AZIMUTHS))


def energy(shape: np.ndarray) -> complex:
    return complex(0.5 * _UNIT * simpson(curvatures(shape) ** 2, x=_S))


def _frictionless(shape: np.ndarray, loads: Loads) -> complex:
    work = loads.force @ tip(shape) - loads.tensions @ lengths(shape)
    return complex(energy(shape) - work) / _UNIT


def _with_friction(shape: np.ndarray, at: np.ndarray, loads: Loads) -> complex:
    """The tensions are those at ``at``: friction has no energy of its own."""
    bent = cumulative_trapezoid(np.abs(curvatures(at)), _S, initial=0.0)
    f = loads.sliding[:, None]
    left = (loads.tensions[:, None] - f * loads.coulomb) * np.exp(-f * loads.friction * bent)
    toward = np.cos(shape[3] + _AZIMUTHS)[:, None]
    local = LENGTH - PITCH_RADIUS * curvatures(shape) * toward
    work = loads.force @ tip(shape) - simpson(left * local, x=_S).sum()
    return complex(energy(shape) - work) / _UNIT


def _slopes(function: object, shape: np.ndarray, *more: object) -> np.ndarray:
    assert callable(function)
    steps = 1e-30j * np.eye(4)
    return np.array([function(shape + step, *more).imag * 1e30 for step in steps])


def at_rest(loads: Loads) -> np.ndarray:
    """S = (m0, m1, m2, delta) of the segment under ``loads``, near its free bend; theta >= 0."""
    towards = PITCH_RADIUS / _UNIT * (loads.tensions[:2] - loads.tensions[2:])
    start = np.array([math.hypot(*towards), 0.0, 0.0, math.atan2(-towards[1], towards[0])])
    found = minimize(
        lambda shape: _frictionless(shape, loads).real, start,
        jac=lambda shape: _slopes(_frictionless, shape, loads), options={"gtol": 1e-9},
    )  # fmt: skip
    shape = found.x
    if loads.friction > 0.0 or loads.coulomb > 0.0:
        found = root(lambda shape: _slopes(_with_friction, shape, shape, loads), shape, tol=1e-12)
        assert found.success, found.message
        shape = found.x
    if bends(shape)[-1] < 0.0:
        shape = np.append(-shape[:3], shape[3] + math.pi)
    shape[3] = math.remainder(shape[3], 2.0 * math.pi)
    return np.asarray(shape)


def bending_tensions(bend: float, delta: float, pretension: float = 0.3) -> np.ndarray:
    """Tensions (4,) in N that bend a segment by ``bend`` (rad) when nothing touches it."""
    pulls = _UNIT * bend / PITCH_RADIUS * np.cos(delta + _AZIMUTHS)
    return np.asarray(pretension + np.maximum(pulls, 0.0))
