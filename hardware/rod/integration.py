"""The rod from its base to its tip, when the force on the tip and the tip's place are given.

Source: D. C. Rucker and R. J. Webster, "Statics and Dynamics of Continuum Robots With General
Tendon Routing and External Loading", 2011. Tendon i runs along r_i = p + R rho_i in the direction
t_i and loads the backbone with the force (T_i t_i)' and the moment R rho_i x (T_i t_i)' per length;
this holds with friction too, whose part of it is T_i' t_i. At the tip, where it ends, it pulls with
-T_i t_i. Two of the rod's equations of balance can then be integrated once and for all:

    n + sum T_i t_i = F,    m + sum R rho_i x T_i t_i = M + (p(L) - p) x F,

with the force F and the moment M that the environment exerts on the tip. What remains is, at each
place, to find the curvature whose moment m = R diag(EI, EI, GJ) kappa balances the second of them.

All compiled functions of the rod are in this file, because numba's cache does not notice that a
function called from another file has changed.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled

STATE = 12
"""At a place: where it is (3,), quaternion w x y z, accumulated bend, changes of length (4,)."""
OUTCOMES = 7
"""What a trial ends with: the tip's place (3,) and the changes of the tendons' lengths (4,), m."""
UNKNOWNS = 8
"""What a trial starts from: the tip's place (3,) over L, the contact force, four sliding shares."""

_BALANCE_ROUNDS = 30
_BALANCE_TOLERANCE = 1e-14
_DIFFERENCE = 1e-7


@compiled
def _balance(
    moment: np.ndarray, rod: np.ndarray, tensions: np.ndarray, curvature: np.ndarray
) -> None:
    """Find the curvature at which the backbone and the tendons carry a moment together.

    The tendon's direction t depends on the curvature, but only through torsion. What is to be zero
    is the gradient of a convex function, so there is one answer.

    Args:
        moment: (3,) moment to be carried, frame of the cross-section, N m.
        rod: (5,) ``RodProperties.constants``.
        tensions: (4,) at this place, N.
        curvature: (3,) start, replaced by the answer, 1/m; NaN where there is none.
    """
    bending, torsion, radius = rod[0], rod[1], rod[2]
    for _ in range(_BALANCE_ROUNDS):
        x, y, z = curvature[0], curvature[1], curvature[2]
        gx, gy, gz = bending * x - moment[0], bending * y - moment[1], torsion * z - moment[2]
        hxx, hyy, hzz = bending, bending, torsion
        hxy, hxz, hyz = 0.0, 0.0, 0.0
        for i in range(4):
            a = radius * (1 - i) if i % 2 == 0 else 0.0
            b = radius * (2 - i) if i % 2 == 1 else 0.0
            # r' = (-z b, z a, w) in the frame of the cross-section, h long.
            w = 1.0 + x * b - y * a
            square = radius * radius
            h = math.sqrt(w * w + z * z * square)
            pull = tensions[i] / h
            gx += pull * b * w
            gy -= pull * a * w
            gz += pull * square * z
            pull /= h * h
            ww, wz = pull * square * z * z, -pull * square * w * z
            hxx += ww * b * b
            hyy += ww * a * a
            hxy -= ww * a * b
            hxz += wz * b
            hyz -= wz * a
            hzz += pull * square * w * w
        cxx, cxy, cxz = hyy * hzz - hyz * hyz, hxz * hyz - hxy * hzz, hxy * hyz - hxz * hyy
        cyy, cyz, czz = hxx * hzz - hxz * hxz, hxy * hxz - hxx * hyz, hxx * hyy - hxy * hxy
        determinant = hxx * cxx + hxy * cxy + hxz * cxz
        dx = -(cxx * gx + cxy * gy + cxz * gz) / determinant
        dy = -(cxy * gx + cyy * gy + cyz * gz) / determinant
        dz = -(cxz * gx + cyz * gy + czz * gz) / determinant
        curvature[0], curvature[1], curvature[2] = x + dx, y + dy, z + dz
        size = abs(x) + abs(y) + abs(z)
        if abs(dx) + abs(dy) + abs(dz) <= _BALANCE_TOLERANCE * (size + 1.0 / radius):
            return
    curvature[:] = np.nan


@compiled
def _slope(
    state: np.ndarray,
    rod: np.ndarray,
    tensions: np.ndarray,
    sliding: np.ndarray,
    load: np.ndarray,
    curvature: np.ndarray,
    here: np.ndarray,
    out: np.ndarray,
) -> None:
    """Derivative of the state along the backbone, per m.

    Args:
        state: (12,) place, quaternion, accumulated bend, changes of length.
        rod: (5,) ``RodProperties.constants``.
        tensions: (4,) at the base, N.
        sliding: (4,) shares in [-1, 1].
        load: (3, 3) force on the tip, moment on the tip, the place at which the force acts.
        curvature: (3,) start for the balance, replaced by the curvature, 1/m.
        here: (2, 4) for the tensions and, in the second row, the moment at this place.
        out: (12,) filled.
    """
    w, x, y, z = state[3], state[4], state[5], state[6]
    norm = w * w + x * x + y * y + z * z
    s = 2.0 / norm
    for i in range(4):
        here[0, i] = tensions[i] * math.exp(-sliding[i] * rod[3] * state[7])
    ax, ay, az = load[2, 0] - state[0], load[2, 1] - state[1], load[2, 2] - state[2]
    mx = load[1, 0] + ay * load[0, 2] - az * load[0, 1]
    my = load[1, 1] + az * load[0, 0] - ax * load[0, 2]
    mz = load[1, 2] + ax * load[0, 1] - ay * load[0, 0]
    # The moment into the frame of the cross-section: R transposed times it.
    here[1, 0] = mx - s * ((y * y + z * z) * mx - (x * y + w * z) * my - (x * z - w * y) * mz)
    here[1, 1] = my - s * ((x * x + z * z) * my - (x * y - w * z) * mx - (y * z + w * x) * mz)
    here[1, 2] = mz - s * ((x * x + y * y) * mz - (x * z + w * y) * mx - (y * z - w * x) * my)
    _balance(here[1, :3], rod, here[0], curvature)
    kx, ky, kz = curvature[0], curvature[1], curvature[2]
    out[0] = s * (x * z + w * y)
    out[1] = s * (y * z - w * x)
    out[2] = 1.0 - s * (x * x + y * y)
    out[3] = -0.5 * (x * kx + y * ky + z * kz)
    out[4] = 0.5 * (w * kx + y * kz - z * ky)
    out[5] = 0.5 * (w * ky + z * kx - x * kz)
    out[6] = 0.5 * (w * kz + x * ky - y * kx)
    out[7] = math.hypot(kx, ky)
    radius = rod[2]
    for i in range(4):
        a = radius * (1 - i) if i % 2 == 0 else 0.0
        b = radius * (2 - i) if i % 2 == 1 else 0.0
        stretch = kx * b - ky * a
        twist = radius * radius * kz * kz
        # sqrt((1 + stretch)^2 + twist) - 1 without cancellation.
        excess = stretch * (2.0 + stretch) + twist
        out[8 + i] = excess / (1.0 + math.sqrt(1.0 + excess))


@compiled
def trace(
    rod: np.ndarray,
    tensions: np.ndarray,
    sliding: np.ndarray,
    load: np.ndarray,
    nodes: np.ndarray,
    curvatures: np.ndarray,
) -> None:
    """Integrate from the clamped base to the tip by the classical Runge-Kutta rule.

    Args:
        rod: (5,) ``RodProperties.constants``.
        tensions: (4,) at the base, N.
        sliding: (4,) shares in [-1, 1].
        load: (3, 3) force on the tip (N), moment on the tip (N m), the place at which the force
            is taken to act (m); the answer is the rod's only if the rod's tip comes out there.
        nodes: (n, 12) filled with place (m), unit quaternion (w, x, y, z), accumulated bend (rad)
            and changes of the tendons' lengths up to there (m), from the base to the tip.
        curvatures: (n, 3) filled with the curvature in the frame of the cross-section, 1/m.
    """
    count = nodes.shape[0]
    step = rod[4] / (count - 1)
    slopes, state = np.empty((4, STATE)), np.empty(STATE)
    here, curvature = np.zeros((2, 4)), np.zeros(3)
    nodes[0] = 0.0
    nodes[0, 3] = 1.0
    for n in range(count):
        _slope(nodes[n], rod, tensions, sliding, load, curvature, here, slopes[0])
        curvatures[n] = curvature
        if n == count - 1:
            break
        for stage in range(1, 4):
            length = step if stage == 3 else 0.5 * step
            for k in range(STATE):
                state[k] = nodes[n, k] + length * slopes[stage - 1, k]
            _slope(state, rod, tensions, sliding, load, curvature, here, slopes[stage])
        norm = 0.0
        for k in range(STATE):
            mean = slopes[0, k] + 2.0 * (slopes[1, k] + slopes[2, k]) + slopes[3, k]
            nodes[n + 1, k] = nodes[n, k] + step * mean / 6.0
            if 3 <= k < 7:
                norm += nodes[n + 1, k] ** 2
        for k in range(3, 7):
            nodes[n + 1, k] /= math.sqrt(norm)


@compiled
def outcome(
    unknowns: np.ndarray,
    rod: np.ndarray,
    tensions: np.ndarray,
    force: np.ndarray,
    moment: np.ndarray,
    normal: np.ndarray,
    nodes: np.ndarray,
    curvatures: np.ndarray,
    out: np.ndarray,
) -> None:
    """One trial: what comes of the unknowns.

    Args:
        unknowns: (8,) place of the tip over L, contact force (N), sliding shares.
        rod: (5,) ``RodProperties.constants``.
        tensions: (4,) at the base, N.
        force: (3,) on the tip apart from the contact, N.
        moment: (3,) on the tip, N m.
        normal: (3,) direction of the contact force.
        nodes: (n, 12) filled by ``trace``.
        curvatures: (n, 3) filled by ``trace``.
        out: (7,) filled with the tip's place and the changes of length, m.
    """
    load = np.empty((3, 3))
    for k in range(3):
        load[0, k] = force[k] + unknowns[3] * normal[k]
        load[1, k] = moment[k]
        load[2, k] = unknowns[k] * rod[4]
    trace(rod, tensions, unknowns[4:], load, nodes, curvatures)
    last = nodes.shape[0] - 1
    for k in range(3):
        out[k] = nodes[last, k]
    for k in range(4):
        out[3 + k] = nodes[last, 8 + k]


@compiled
def sensitivity(
    unknowns: np.ndarray,
    free: np.ndarray,
    rod: np.ndarray,
    tensions: np.ndarray,
    force: np.ndarray,
    moment: np.ndarray,
    normal: np.ndarray,
    steps: int,
    at: np.ndarray,
    out: np.ndarray,
) -> None:
    """Derivative of ``outcome`` by the unknowns that are free, by forward differences.

    Args:
        unknowns: (8,) see ``outcome``.
        free: (8,) True for the unknowns to differentiate by.
        rod: (5,) ``RodProperties.constants``.
        tensions: (4,) at the base, N.
        force: (3,) on the tip apart from the contact, N.
        moment: (3,) on the tip, N m.
        normal: (3,) direction of the contact force.
        steps: of the integration.
        at: (7,) outcome of the unknowns.
        out: (7, 8) filled; columns that are not free are zero.
    """
    nodes, curvatures = np.empty((steps + 1, STATE)), np.empty((steps + 1, 3))
    moved, after = unknowns.copy(), np.empty(OUTCOMES)
    for k in range(UNKNOWNS):
        out[:, k] = 0.0
        if free[k]:
            moved[k] = unknowns[k] + _DIFFERENCE
            outcome(moved, rod, tensions, force, moment, normal, nodes, curvatures, after)
            moved[k] = unknowns[k]
            for row in range(OUTCOMES):
                out[row, k] = (after[row] - at[row]) / _DIFFERENCE
