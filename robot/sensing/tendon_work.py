"""What four tendons with friction do to the modes of curvature: generalised forces, lengths.

The tension of tendon i falls from the base, where it is measured, toward the tip while the tendon
slides toward the base (share f_i = 1), and grows while it slides back (f_i = -1):

    T_i(s) = (tau_i - f_i g c) exp(-f_i g mu phi(s)),   phi(s) = int_0^s |kappa| ds

with the capstan coefficient mu, a Coulomb part c in N, and g, how much of the calibrated friction
there is. By virtual work, with l_i' = L + y_i k_x - x_i k_y for a tendon at (x_i, y_i):

    Q_a = -sum_i int T_i(s) (y_i phi_a,x - x_i phi_a,y) ds.

Between n disks tendons run straight, which shortens each by L |k|^2 / (8 n^2) per unit of s
(``chord`` = L / (8 n^2), 0 for a tendon in a lumen, as paper 3 has it): tension then helps the
bend, by a sixth of its stiffness for two newtons on each tendon of the first robot. Twist lengthens
all tendons in second order, l_i' = sqrt(d_i^2 + (r k_z)^2) with d_i = L + y_i k_x - x_i k_y, so
that tensions resist it: Q_a = -sum_i int T_i r^2 k_z phi_a,z / d_i ds. (Three newtons on each of
four tendons add a tenth to the torsional stiffness of a 0.5 mm rod.) Without friction the bending
part is -J_q^T tau (paper 3, eq. (41) with the sign that its q needs).
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.sensing.curvature_modes import INTEGRAL, NORMS, ORDERS, PLACES, WEIGHTS, basis, curvature

TENDONS = 4
_STRAIGHT_RAD = 1e-3
"""Rounds |kappa| off where the segment is straight, so that it has a derivative there."""
_X = np.array([1.0, 0.0, -1.0, 0.0])
_Y = np.array([0.0, 1.0, 0.0, -1.0])


@compiled
def tendon_lengths_of_modes(
    z: np.ndarray, pitch_radius: float, chord: float, out: np.ndarray
) -> None:
    """Length changes (4,) in m of the tendons, in the bending modes. Negative: pulled."""
    shared = 0.0
    for a in range(2 * ORDERS):
        shared -= chord * NORMS[a] * z[a] * z[a]
    for i in range(4):
        out[i] = shared + pitch_radius * (_Y[i] * z[0] - _X[i] * z[ORDERS])


@compiled
def bending_to_nodes(z: np.ndarray, phi: np.ndarray, slopes: np.ndarray) -> None:
    """Bend accumulated up to each node and how it changes with the modes.

    Args:
        z: (11,) modes.
        phi: (n,) filled, rad.
        slopes: (n, 8) filled: per mode of bending.
    """
    count = PLACES.size
    size, rates, values = np.empty(count), np.empty((count, 2 * ORDERS)), np.empty(ORDERS)
    for j in range(count):
        basis(PLACES[j], values)
        x, y = 0.0, 0.0
        for k in range(ORDERS):
            x += values[k] * z[k]
            y += values[k] * z[ORDERS + k]
        size[j] = math.sqrt(x * x + y * y + _STRAIGHT_RAD * _STRAIGHT_RAD)
        for k in range(ORDERS):
            rates[j, k] = values[k] * x / size[j]
            rates[j, ORDERS + k] = values[k] * y / size[j]
    phi[:], slopes[:] = 0.0, 0.0
    for j in range(count):
        for k in range(count):
            w = INTEGRAL[j, k]
            phi[j] += w * size[k]
            for a in range(2 * ORDERS):
                slopes[j, a] += w * rates[k, a]


@compiled
def _resist_twist(
    i: int,
    at_node: tuple[float, float, float, float, float],
    values: np.ndarray,
    bend: np.ndarray,
    by: tuple[float, float, float],
    slope: np.ndarray,
    force: np.ndarray,
    per_mode: np.ndarray,
    per_tension: np.ndarray,
    per_sliding: np.ndarray,
    per_level: np.ndarray,
) -> None:
    """What tendon ``i`` adds at one node to the generalised forces of the modes of twist.

    ``at_node`` holds its weight, pitch radius and segment length in m, the tension in N and the
    share of it that is left there; ``by`` how the tension changes with accumulated bend, sliding
    share and level; ``slope`` (8,) how the accumulated bend changes. What follows is added to.
    """
    weight, radius, length, tension, left = at_node
    by_phi, by_sliding, by_level = by
    spread = length + radius * (_Y[i] * bend[0] - _X[i] * bend[1])
    resisting = -weight * radius * radius / spread
    for k in range(ORDERS - 1):
        a = 2 * ORDERS + k
        w = resisting * bend[2] * values[k]
        force[a] += w * tension
        per_tension[a, i] += w * left
        per_sliding[a, i] += w * by_sliding
        per_level[a] += w * by_level
        for b in range(ORDERS - 1):
            per_mode[a, 2 * ORDERS + b] += resisting * values[k] * values[b] * tension
        for b in range(2 * ORDERS):
            lever = _Y[i] if b < ORDERS else -_X[i]
            closer = -tension * radius * lever * values[b % ORDERS] / spread
            per_mode[a, b] += w * (by_phi * slope[b] + closer)


@compiled
def tendon_forces(
    z: np.ndarray,
    tensions: np.ndarray,
    sliding: np.ndarray,
    friction: tuple[float, float, float],
    routing: tuple[float, float, float],
    force: np.ndarray,
    per_mode: np.ndarray,
    per_tension: np.ndarray,
    per_sliding: np.ndarray,
    per_level: np.ndarray,
) -> None:
    """Generalised forces of the tendons on the modes, and every derivative.

    Args:
        z: (11,) modes.
        tensions: (4,) at the base, N.
        sliding: (4,) shares f, -1 to 1.
        friction: mu, c in N, and the level g.
        routing: pitch radius, length of the segment and ``chord``, m.
        force: (11,) filled, N m.
        per_mode: (11, 11) filled, N m.
        per_tension: (11, 4) filled, m.
        per_sliding: (11, 4) filled, N m.
        per_level: (11,) filled, N m.
    """
    mu, coulomb, level = friction
    pitch_radius, length, chord = routing
    count = PLACES.size
    phi, slopes = np.empty(count), np.empty((count, 2 * ORDERS))
    bending_to_nodes(z, phi, slopes)
    force[:], per_mode[:], per_tension[:] = 0.0, 0.0, 0.0
    per_sliding[:], per_level[:] = 0.0, 0.0
    values, bend = np.empty(ORDERS), np.empty(3)
    for j in range(count):
        basis(PLACES[j], values)
        curvature(z, PLACES[j], bend)
        for i in range(4):
            f = sliding[i]
            left = math.exp(-f * level * mu * phi[j])
            base = tensions[i] - f * level * coulomb
            tension = base * left
            by_phi = -f * level * mu * tension
            by_sliding = -level * (coulomb * left + mu * phi[j] * tension)
            by_level = -f * (coulomb * left + mu * phi[j] * tension)
            for k in range(2 * ORDERS):
                about = k // ORDERS
                lever = pitch_radius * (-_Y[i] if about == 0 else _X[i])
                value = WEIGHTS[j] * values[k % ORDERS]
                w = value * (lever + 2.0 * chord * bend[about])
                for b in range(ORDERS):
                    helped = 2.0 * chord * value * values[b] * tension
                    per_mode[k, about * ORDERS + b] += helped
                force[k] += w * tension
                per_tension[k, i] += w * left
                per_sliding[k, i] += w * by_sliding
                per_level[k] += w * by_level
                for b in range(2 * ORDERS):
                    per_mode[k, b] += w * by_phi * slopes[j, b]
            twisting = (WEIGHTS[j], pitch_radius, length, tension, left)
            _resist_twist(
                i, twisting, values, bend, (by_phi, by_sliding, by_level), slopes[j],
                force, per_mode, per_tension, per_sliding, per_level,
            )  # fmt: skip
