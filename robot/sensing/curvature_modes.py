"""A segment that bends in both planes and twists: curvature as polynomials along the backbone.

With R' = R k^ and p' = L R e3 along the normalised arc length s in [0, 1], the curvature is
k(s) = sum_a phi_a(s) z_a with eleven modes: shifted Legendre polynomials of order 0 to 3 about x
and y, of order 0 to 2 about z. z[0] and z[4] are the bends v and u of :mod:`robot.segment`, and the
only modes that change tendon lengths; a segment bent in one plane with paper 3's S = (m0, m1, m2,
delta) has kappa(s) = m0 + m1 s + m2 s^2 about (sin delta, cos delta, 0). One order more than the
paper's, since a force at the tip bends the segment by more than a quadratic. Unlike (m, delta)
these coordinates have no singular point where the segment is straight, and a force out of the
bending plane has somewhere to show.

Positions come from Gauss-Legendre nodes, rotations from one node to the next by the sixth-order
Magnus expansion.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.rotations import exponential, multiply
from robot.sensing.records import CURVATURE_MODES

ORDERS = 4
"""Polynomials of bending about each axis; twist has one less."""
MODES = CURVATURE_MODES
"""Curvature about x, about y, about z."""
V_MODE, U_MODE, TWIST = 0, ORDERS, 2 * ORDERS
"""The modes that are the bends v and u, and the first of twist; rad."""
NORMS = np.array([1.0 / (2.0 * (a % ORDERS) + 1.0) for a in range(MODES)])
"""Squared norms of the modes."""
NODES = 10
_ROOT15 = math.sqrt(15.0)


def _collocation() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes (n,) and weights (n,) on [0, 1], and the matrix (n, n) that integrates
    from 0 to each node.
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    powers = np.arange(NODES)
    values = nodes[:, None] ** powers
    integrals = nodes[:, None] ** (powers + 1) / (powers + 1)
    return nodes, weights, np.linalg.solve(values.T, integrals.T).T


PLACES, WEIGHTS, INTEGRAL = _collocation()


@compiled
def basis(s: float, out: np.ndarray) -> None:
    """Shifted Legendre polynomials of order 0 to 3 at ``s``, written to ``out`` (4,)."""
    out[0] = 1.0
    out[1] = 2.0 * s - 1.0
    out[2] = (6.0 * s - 6.0) * s + 1.0
    out[3] = ((20.0 * s - 30.0) * s + 12.0) * s - 1.0


@compiled
def curvature(z: np.ndarray, s: float, out: np.ndarray) -> None:
    """Curvature (3,) per normalised arc length at ``s``, material frame, rad."""
    values = np.empty(ORDERS)
    basis(s, values)
    for i in range(3):
        out[i] = 0.0
        for k in range(ORDERS if i < 2 else ORDERS - 1):
            out[i] += values[k] * z[i * ORDERS + k]


@compiled
def _cross(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def _turn_between(
    z: np.ndarray, start: float, end: float, before: np.ndarray, after: np.ndarray
) -> None:
    """Rotation (3, 3) at ``end`` of the one at ``start``: one step of the Magnus expansion.

    Written for R^T, of which R' = R k^ is an equation from the left, hence the signs.
    """
    h = end - start
    first, middle, last = np.empty(3), np.empty(3), np.empty(3)
    curvature(z, start + h * (0.5 - 0.1 * _ROOT15), first)
    curvature(z, start + h * 0.5, middle)
    curvature(z, start + h * (0.5 + 0.1 * _ROOT15), last)
    a1, a2, a3 = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        a1[i] = -h * middle[i]
        a2[i] = -h * _ROOT15 / 3.0 * (last[i] - first[i])
        a3[i] = -h * 10.0 / 3.0 * (last[i] - 2.0 * middle[i] + first[i])
    c1, c2, vector, step = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    _cross(a1, a2, c1)
    for i in range(3):
        vector[i] = 2.0 * a3[i] + c1[i]
    _cross(a1, vector, c2)
    for i in range(3):
        c1[i] += -20.0 * a1[i] - a3[i]
        c2[i] = a2[i] - c2[i] / 60.0
    _cross(c1, c2, vector)
    for i in range(3):
        vector[i] = -(a1[i] + a3[i] / 12.0 + vector[i] / 240.0)
    exponential(vector, step)
    multiply(before, step, after)


@compiled
def frames_at_nodes(
    z: np.ndarray,
    length: float,
    rotations: np.ndarray,
    positions: np.ndarray,
    tip_rotation: np.ndarray,
    tip_position: np.ndarray,
) -> None:
    """Frames at the nodes and at the tip, in the segment's base frame.

    Args:
        z: (11,) modes.
        length: of the segment, m.
        rotations: (n, 3, 3) filled.
        positions: (n, 3) filled, m.
        tip_rotation: (3, 3) filled.
        tip_position: (3,) filled, m.
    """
    count = PLACES.size
    before = np.eye(3)
    last = 0.0
    for j in range(count):
        _turn_between(z, last, PLACES[j], before, rotations[j])
        before, last = rotations[j], PLACES[j]
    _turn_between(z, last, 1.0, before, tip_rotation)
    for i in range(3):
        tip_position[i] = 0.0
        for j in range(count):
            tip_position[i] += length * WEIGHTS[j] * rotations[j, i, 2]
            total = 0.0
            for k in range(count):
                total += INTEGRAL[j, k] * rotations[k, i, 2]
            positions[j, i] = length * total


@compiled
def turned_axes(rotations: np.ndarray, axes: np.ndarray) -> None:
    """How each mode turns the backbone at each node: R phi_a, ``axes`` (n, 11, 3) filled."""
    values = np.empty(ORDERS)
    for j in range(PLACES.size):
        basis(PLACES[j], values)
        for a in range(MODES):
            about, order = a // ORDERS, a % ORDERS
            for i in range(3):
                axes[j, a, i] = rotations[j, i, about] * values[order]


@compiled
def tip_jacobian_of_modes(
    axes: np.ndarray, positions: np.ndarray, tip_position: np.ndarray, out: np.ndarray
) -> None:
    """Tip twist per mode, ``out`` (6, 11): linear (m) then angular (rad) rows, base frame.

    d theta = int R dk ds;  d p = int (R dk) x (p(1) - p(s)) ds.
    """
    out[:] = 0.0
    for j in range(PLACES.size):
        w = WEIGHTS[j]
        x = tip_position[0] - positions[j, 0]
        y = tip_position[1] - positions[j, 1]
        z = tip_position[2] - positions[j, 2]
        for a in range(MODES):
            p, q, r = axes[j, a, 0], axes[j, a, 1], axes[j, a, 2]
            out[0, a] += w * (q * z - r * y)
            out[1, a] += w * (r * x - p * z)
            out[2, a] += w * (p * y - q * x)
            out[3, a] += w * p
            out[4, a] += w * q
            out[5, a] += w * r


@compiled
def _second_order(
    rotations: np.ndarray,
    axes: np.ndarray,
    offset: np.ndarray,
    length: float,
    turned: np.ndarray,
    moved: np.ndarray,
    to_tip: np.ndarray,
) -> None:
    """How each mode turns (n, 11, 3) and moves (n, 11, 3) every node, and moves the point that is
    ``offset`` from the tip (11, 3); all three are zero before.
    """
    count = PLACES.size
    for j in range(count):
        for b in range(MODES):
            for i in range(3):
                total = 0.0
                for k in range(count):
                    total += INTEGRAL[j, k] * axes[k, b, i]
                turned[j, b, i] = total
    # How the tangent L R e3 changes at each node, integrated from the base to node and tip.
    for b in range(MODES):
        rate = np.empty((count, 3))
        for j in range(count):
            x, y, z = length * rotations[j, 0, 2], length * rotations[j, 1, 2], 0.0
            z = length * rotations[j, 2, 2]
            p, q, r = turned[j, b, 0], turned[j, b, 1], turned[j, b, 2]
            rate[j, 0] = q * z - r * y
            rate[j, 1] = r * x - p * z
            rate[j, 2] = p * y - q * x
        for i in range(3):
            for j in range(count):
                to_tip[b, i] += WEIGHTS[j] * rate[j, i]
                for k in range(count):
                    moved[j, b, i] += INTEGRAL[j, k] * rate[k, i]
    for b in range(MODES):
        p, q, r = 0.0, 0.0, 0.0
        for j in range(count):
            p += WEIGHTS[j] * axes[j, b, 0]
            q += WEIGHTS[j] * axes[j, b, 1]
            r += WEIGHTS[j] * axes[j, b, 2]
        to_tip[b, 0] += q * offset[2] - r * offset[1]
        to_tip[b, 1] += r * offset[0] - p * offset[2]
        to_tip[b, 2] += p * offset[1] - q * offset[0]


@compiled
def force_stiffness(
    rotations: np.ndarray,
    axes: np.ndarray,
    positions: np.ndarray,
    tip_position: np.ndarray,
    offset: np.ndarray,
    length: float,
    force: np.ndarray,
    out: np.ndarray,
) -> None:
    """How J_p^T F changes with the modes: ``out`` (11, 11), N m, the Hessian of p . F.

    p is the point that is ``offset`` (3,) m from the tip and moves with it. With
    theta_b(s) = int_0^s R phi_b, the entry is
    int (theta_b x R phi_a) . ((p - p(s)) x F) + R phi_a . (d_b (p - p(s)) x F) ds.
    """
    count = PLACES.size
    turned, moved = np.zeros((count, MODES, 3)), np.zeros((count, MODES, 3))
    to_tip = np.zeros((MODES, 3))
    _second_order(rotations, axes, offset, length, turned, moved, to_tip)
    out[:] = 0.0
    lever, arm = np.empty(3), np.empty(3)
    for j in range(count):
        for i in range(3):
            lever[i] = tip_position[i] + offset[i] - positions[j, i]
        mx = lever[1] * force[2] - lever[2] * force[1]
        my = lever[2] * force[0] - lever[0] * force[2]
        mz = lever[0] * force[1] - lever[1] * force[0]
        w = WEIGHTS[j]
        for b in range(MODES):
            for i in range(3):
                arm[i] = to_tip[b, i] - moved[j, b, i]
            nx = arm[1] * force[2] - arm[2] * force[1]
            ny = arm[2] * force[0] - arm[0] * force[2]
            nz = arm[0] * force[1] - arm[1] * force[0]
            # (theta x a) . m = a . (m x theta)
            p, q, r = turned[j, b, 0], turned[j, b, 1], turned[j, b, 2]
            nx += my * r - mz * q
            ny += mz * p - mx * r
            nz += mx * q - my * p
            for a in range(MODES):
                out[a, b] += w * (axes[j, a, 0] * nx + axes[j, a, 1] * ny + axes[j, a, 2] * nz)


def shape_of_modes(
    z: np.ndarray, length: float, fractions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Frames along the backbone, for drawing and for errors of shape.

    Args:
        z: (11,) modes.
        length: of the segment, m.
        fractions: (n,) places along the backbone, ascending, 0 at the base and 1 at the tip.

    Returns:
        Positions (n, 3) in m and rotation matrices (n, 3, 3), in the segment's base frame.
    """
    positions = np.zeros((len(fractions), 3))
    rotations = np.zeros((len(fractions), 3, 3))
    _shape(np.asarray(z, float), length, np.asarray(fractions, float), positions, rotations)
    return positions, rotations


@compiled
def _shape(
    z: np.ndarray,
    length: float,
    fractions: np.ndarray,
    positions: np.ndarray,
    rotations: np.ndarray,
) -> None:
    count = PLACES.size
    nodes, places = np.empty((count, 3, 3)), np.empty((count, 3))
    tip_rotation, tip_position = np.empty((3, 3)), np.empty(3)
    part = np.zeros(MODES)
    for n in range(fractions.size):
        _part_of(z, fractions[n], part)
        frames_at_nodes(part, length * fractions[n], nodes, places, tip_rotation, tip_position)
        positions[n] = tip_position
        rotations[n] = tip_rotation


@compiled
def _part_of(z: np.ndarray, f: float, part: np.ndarray) -> None:
    """Modes of the piece from the base to the fraction ``f``, itself a segment: f k(f s)."""
    values, there = np.empty(ORDERS), np.empty(ORDERS)
    part[:] = 0.0
    for j in range(PLACES.size):
        basis(PLACES[j], values)
        basis(f * PLACES[j], there)
        for a in range(MODES):
            about, total = a // ORDERS, 0.0
            for k in range(ORDERS if about < 2 else ORDERS - 1):
                total += there[k] * z[about * ORDERS + k]
            order = a % ORDERS
            part[a] += WEIGHTS[j] * (2.0 * order + 1.0) * values[order] * f * total
