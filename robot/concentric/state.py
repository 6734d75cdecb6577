"""What is carried along an arm from the channel's exit to its tip, section by section.

The frame is the one that follows the backbone without turning about it (Bishop's); tube i is
turned in it by the angle ψ_i about the tangent. All of it is differentiated by 3n parameters: the
translations β, the rotations α, and the torsion rates ω at the channel's exit, which the boundary
problem then makes a function of the other two.

Tubes that share a backbone bend it by u = Σ share_i (cos ψ_i, sin ψ_i, 0) with
share_i = EI_i κ_i / Σ EI, the sum over the tubes that are there and the numerator over those that
are curved there, and twist each other by ψ_i'' = gain_i (sin ψ_i u_x − cos ψ_i u_y) with
gain_i = EI_i κ_i / GJ_i. (Dupont, Lock, Itkowitz & Butler 2010; Rucker, Webster, Chirikjian &
Cowan 2010, without external loads.)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robot.compiled import compiled


class ArmState(NamedTuple):
    """The state at one arc length; every array is overwritten on the way.

    Attributes:
        angle: (n,) ψ, rad.
        rate: (n,) torsion rate ψ', rad/m.
        angle_change: (n, 3n) derivative of ``angle`` at this arc length.
        rate_change: (n, 3n) derivative of ``rate`` at this arc length.
        position: (3,) m, base frame.
        rotation: (3, 3) Bishop frame in the base frame; its third column is the tangent.
        turn: (3, 3n) rad per parameter: how the Bishop frame turns, base frame.
        moment: (3, 3n) m·rad per parameter: ∫ p × d(turn), so that the position at p changes by
            turn × p + moment.
        share: (n,) curvature that each tube contributes here, 1/m.
        gain: (n,) EI κ / GJ of the tubes that are curved here, 1/m.
        present: (n,) 1 where the tube is there, else 0.
        curved: (n,) 1 where the tube is there and curved, else 0.
    """

    angle: np.ndarray
    rate: np.ndarray
    angle_change: np.ndarray
    rate_change: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    turn: np.ndarray
    moment: np.ndarray
    share: np.ndarray
    gain: np.ndarray
    present: np.ndarray
    curved: np.ndarray


@compiled
def state_at_exit(q: np.ndarray, torsion: np.ndarray) -> ArmState:
    """The state at s = 0, all tubes there and none curved.

    In the channel tubes are held straight, so that nothing twists them there and their torsion rate
    is constant, in a curved part that is still inside as well: ψ_i(0) = α_i − β_i ω_i.

    Args:
        q: (2n,) translations in m, rotations in rad.
        torsion: (n,) torsion rates ω at s = 0, rad/m.
    """
    count = len(torsion)
    state = ArmState(
        np.empty(count),
        np.empty(count),
        np.zeros((count, 3 * count)),
        np.zeros((count, 3 * count)),
        np.zeros(3),
        np.zeros((3, 3)),
        np.zeros((3, 3 * count)),
        np.zeros((3, 3 * count)),
        np.zeros(count),
        np.zeros(count),
        np.ones(count),
        np.zeros(count),
    )
    for row in range(3):
        state.rotation[row, row] = 1.0
    for index in range(count):
        state.rate[index] = torsion[index]
        state.angle[index] = q[count + index] - q[index] * torsion[index]
        state.angle_change[index, index] = -torsion[index]
        state.angle_change[index, count + index] = 1.0
        state.angle_change[index, 2 * count + index] = -q[index]
        state.rate_change[index, 2 * count + index] = 1.0
    return state


@compiled
def share_out(state: ArmState, tubes: np.ndarray, coupling: float) -> None:
    """Fill ``share`` and ``gain`` from the tubes that are present and curved.

    Args:
        state: of the arm.
        tubes: (n,) ``TUBE``.
        coupling: 1; less where the solution is followed up from tubes that do not twist each other.
    """
    whole = 0.0
    for index in range(len(tubes)):
        whole += state.present[index] * tubes[index]["bending_stiffness"]
    for index in range(len(tubes)):
        bend = state.curved[index] * tubes[index]["bending_stiffness"] * tubes[index]["curvature"]
        state.share[index] = bend / whole if whole > 0.0 else 0.0
        state.gain[index] = coupling * bend / tubes[index]["torsional_stiffness"]


@compiled
def curvature(state: ArmState) -> tuple[float, float]:
    """(u_x, u_y) of the backbone in the Bishop frame, 1/m."""
    x = y = 0.0
    for index in range(len(state.share)):
        if state.share[index] != 0.0:
            x += state.share[index] * math.cos(state.angle[index])
            y += state.share[index] * math.sin(state.angle[index])
    return x, y


@compiled
def twisting(state: ArmState, index: int, bend: tuple[float, float]) -> float:
    """ψ'' of tube ``index`` where the backbone bends by ``bend`` (1/m), rad/m²."""
    if state.gain[index] == 0.0:
        return 0.0
    gain, angle = float(state.gain[index]), float(state.angle[index])
    return gain * (math.sin(angle) * bend[0] - math.cos(angle) * bend[1])
