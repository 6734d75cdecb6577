"""A segment that bends in one plane, its curvature a quadratic along the backbone: paper 3.

The state is S = (m0, m1, m2, delta), (4,) in rad: at the normalised arc length s in [0, 1] the
curvature is kappa = m0 + m1 s + m2 s^2 and the bend theta(s) = m0 s + m1 s^2/2 + m2 s^3/3; the tip
leans to (cos delta, -sin delta). (m, delta) and (-m, delta + pi) are the same shape. Where the
segment is straight, the columns of delta vanish and nothing else happens.

Source: paper 3, section III, eqs. (1)-(42). Corrections: the first entry of the vector in (35) is
0; (37) contradicts (36), from which its columns follow here; in (40) kappa is per normalised s, so
that U = EI/(2L) int kappa^2 ds; the gradient (42) of that is EI/L times the Hilbert matrix.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled

STATES = 4
TENDONS = 4
HILBERT = np.array([[1.0, 1 / 2, 1 / 3], [1 / 2, 1 / 3, 1 / 4], [1 / 3, 1 / 4, 1 / 5]])
"""int s^(i+j) ds: the elastic energy is EI/(2L) m^T H m."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)
PLACES, WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
"""Gauss-Legendre nodes and weights (n,) on [0, 1]; they leave 1e-14 of a position while m1 and m2
stay below 6 rad."""
_COSINES, _SINES = np.array([1.0, 0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0, -1.0])
"""Of the tendons' azimuths, i times 90 degrees."""


@compiled
def curvature_at(shape: np.ndarray, s: float) -> float:
    """kappa(s), rad per normalised arc length; paper 3, eq. (1)."""
    return float(shape[0] + s * (shape[1] + s * shape[2]))


@compiled
def bend_at(shape: np.ndarray, s: float) -> float:
    """theta(s), the bend between the base and ``s``, rad; paper 3, eq. (1)."""
    return float(s * (shape[0] + s * (0.5 * shape[1] + s * shape[2] / 3.0)))


@compiled
def frame_at(
    shape: np.ndarray, length: float, s: float, position: np.ndarray, rotation: np.ndarray
) -> None:
    """The frame at ``s`` in the segment's base frame; paper 3, eqs. (2)-(9).

    Args:
        shape: (4,) S.
        length: of the segment, m.
        s: normalised arc length.
        position: (3,) filled, m.
        rotation: (3, 3) filled: Rz(-delta) Ry(theta) Rz(delta).
    """
    aside, ahead = 0.0, 0.0
    for j in range(PLACES.size):
        theta = bend_at(shape, s * PLACES[j])
        aside += WEIGHTS[j] * math.sin(theta)
        ahead += WEIGHTS[j] * math.cos(theta)
    x, y = math.cos(shape[3]), -math.sin(shape[3])
    position[0], position[1] = length * s * aside * x, length * s * aside * y
    position[2] = length * s * ahead
    theta = bend_at(shape, s)
    sine, half = math.sin(theta), math.sin(0.5 * theta)
    versine = 2.0 * half * half
    rotation[0, 0], rotation[0, 1] = 1.0 - versine * x * x, -versine * x * y
    rotation[1, 0], rotation[1, 1] = -versine * x * y, 1.0 - versine * y * y
    rotation[0, 2], rotation[1, 2] = sine * x, sine * y
    rotation[2, 0], rotation[2, 1] = -sine * x, -sine * y
    rotation[2, 2] = 1.0 - versine


@compiled
def tip_pose(shape: np.ndarray, length: float, position: np.ndarray, rotation: np.ndarray) -> None:
    """Pose of the tip in the segment's base frame: ``position`` (3,) in m, ``rotation`` (3, 3)."""
    frame_at(shape, length, 1.0, position, rotation)


@compiled
def position_jacobian(shape: np.ndarray, length: float, out: np.ndarray) -> None:
    """J_pS, ``out`` (3, 4) in m/rad: the tip's velocity per rate of S; paper 3, eqs. (27)-(35).

    The column of delta is Rz(-delta) L int [0, -sin theta, 0]: (35) prints cos theta for the 0.
    """
    x, y = math.cos(shape[3]), -math.sin(shape[3])
    out[:] = 0.0
    for j in range(PLACES.size):
        s = PLACES[j]
        theta = bend_at(shape, s)
        sine, cosine = math.sin(theta), math.cos(theta)
        w = length * WEIGHTS[j]
        power = s
        for i in range(3):
            turned = w * power / (i + 1.0)
            out[0, i] += turned * cosine * x
            out[1, i] += turned * cosine * y
            out[2, i] -= turned * sine
            power *= s
        out[0, 3] += w * sine * y
        out[1, 3] -= w * sine * x


@compiled
def rotation_jacobian(shape: np.ndarray, out: np.ndarray) -> None:
    """J_omegaS, ``out`` (3, 4): the tip's angular velocity per rate of S, segment base frame.

    Paper 3, eq. (36), carried out; (37) as printed is not its derivative.
    """
    theta = bend_at(shape, 1.0)
    sine, cosine = math.sin(shape[3]), math.cos(shape[3])
    for i in range(3):
        out[0, i] = sine / (i + 1.0)
        out[1, i] = cosine / (i + 1.0)
        out[2, i] = 0.0
    half = math.sin(0.5 * theta)
    out[0, 3] = math.sin(theta) * cosine
    out[1, 3] = -math.sin(theta) * sine
    out[2, 3] = -2.0 * half * half


@compiled
def tip_jacobian(shape: np.ndarray, length: float, out: np.ndarray) -> None:
    """J_xS, ``out`` (6, 4): J_pS over J_omegaS; paper 3, eq. (24)."""
    position_jacobian(shape, length, out[:3])
    rotation_jacobian(shape, out[3:])


@compiled
def tendon_lengths(shape: np.ndarray, pitch_radius: float, out: np.ndarray) -> None:
    """Length changes q_i = -r theta cos(delta + i 90 deg), ``out`` (4,) in m; paper 3, eq. (20).

    Negative: pulled. Holds while the pitch radius is smaller than the radius of curvature.
    """
    theta = bend_at(shape, 1.0)
    x, y = math.cos(shape[3]), -math.sin(shape[3])
    for i in range(TENDONS):
        out[i] = -pitch_radius * theta * (_COSINES[i] * x + _SINES[i] * y)


@compiled
def tendon_jacobian(shape: np.ndarray, pitch_radius: float, out: np.ndarray) -> None:
    """J_qS, ``out`` (4, 4) in m/rad: dq per rate of S; paper 3, eq. (23)."""
    theta = bend_at(shape, 1.0)
    x, y = math.cos(shape[3]), -math.sin(shape[3])
    for i in range(TENDONS):
        toward = _COSINES[i] * x + _SINES[i] * y
        for k in range(3):
            out[i, k] = -pitch_radius * toward / (k + 1.0)
        out[i, 3] = -pitch_radius * theta * (_COSINES[i] * y - _SINES[i] * x)


@compiled
def elastic_energy(shape: np.ndarray, stiffness: float, length: float) -> float:
    """U = EI/(2L) m^T H m, J; paper 3, eq. (40) with 1/L for its L.

    Args:
        shape: (4,) S.
        stiffness: EI of the backbone, N m^2.
        length: of the segment, m.
    """
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += HILBERT[i, j] * shape[i] * shape[j]
    return float(0.5 * stiffness / length * total)


@compiled
def energy_gradient(shape: np.ndarray, stiffness: float, length: float, out: np.ndarray) -> None:
    """dU/dS, ``out`` (4,) in N m: EI/L H m and 0; paper 3, eq. (42), corrected."""
    for i in range(3):
        out[i] = 0.0
        for j in range(3):
            out[i] += stiffness / length * HILBERT[i, j] * shape[j]
    out[3] = 0.0


@compiled
def make_canonical(shape: np.ndarray) -> None:
    """Of S = (m, delta) and (-m, delta + pi), keep in place the one that bends by theta >= 0.

    delta comes out in (-pi, pi].
    """
    theta = bend_at(shape, 1.0)
    if theta < 0.0 or (theta == 0.0 and shape[0] < 0.0):
        for i in range(3):
            shape[i] = -shape[i]
        shape[3] += math.pi
    shape[3] = math.atan2(math.sin(shape[3]), math.cos(shape[3]))


def shape_frames(
    shape: np.ndarray, length: float, fractions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Frames along the backbone.

    Args:
        shape: (4,) S.
        length: of the segment, m.
        fractions: (n,) places along the backbone, 0 at the base and 1 at the tip.

    Returns:
        Positions (n, 3) in m and rotation matrices (n, 3, 3), in the segment's base frame.
    """
    positions = np.empty((len(fractions), 3))
    rotations = np.empty((len(fractions), 3, 3))
    for index, fraction in enumerate(fractions):
        frame_at(shape, length, fraction, positions[index], rotations[index])
    return positions, rotations
