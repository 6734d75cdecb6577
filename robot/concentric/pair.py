"""Two arms of the same tubes side by side: A in the channel at −x, B in the one at +x.

The base frame lies in the endoscope's distal face, midway between the channels, z out. The arms'
relative position is x_AB = p_B − p_A, from A's tip to B's; Paper 2 (Alsaka, Cinquin & Chikhaoui
2024), eq. (2): J_AB = [−J_A, J_B] for q_AB = [q_A, q_B], q = [β_1 .. β_n, α_1 .. α_n].
"""

from __future__ import annotations

import numpy as np

from robot.concentric.design import Concentric, ConcentricStart
from robot.concentric.kinematics import SOLVED, solve_arm, solve_cold
from robot.concentric.tubes import tube_array


class PairKinematics:
    """Where both arms stand; memory that :meth:`ArmPair.evaluate` fills.

    Attributes:
        q: (4n,) q_AB, m and rad.
        torsion: (2n,) torsion rates of the tubes at the channel exit, A then B, rad/m.
        torsion_change: (2, n, 2n) their derivatives by each arm's q.
        position: (2, 3) tips of A and B in the base frame, m.
        rotation: (2, 3, 3) their orientations.
        jacobian: (2, 6, 2n) of each tip, linear rows above angular ones.
        relative: (3,) x_AB, m.
        relative_jacobian: (3, 4n) J_AB.
        tracking_jacobian: (3, 4n) J_A, zeros for B's unknowns.
        stability: (2,) stability determinants of A and B.
    """

    def __init__(self, tubes: int) -> None:
        n = tubes
        self.q, self.torsion = np.zeros(4 * n), np.zeros(2 * n)
        self.torsion_change = np.zeros((2, n, 2 * n))
        self.position, self.rotation = np.zeros((2, 3)), np.zeros((2, 3, 3))
        self.jacobian = np.zeros((2, 6, 2 * n))
        self.relative = np.zeros(3)
        self.relative_jacobian = np.zeros((3, 4 * n))
        self.tracking_jacobian = np.zeros((3, 4 * n))
        self.stability = np.zeros(2)

    def take(self, other: PairKinematics) -> None:
        """Stand where ``other`` stands."""
        for name, value in vars(other).items():
            getattr(self, name)[...] = value


class ArmPair:
    """The model of both arms.

    Attributes:
        count: tubes of an arm, n.
        tubes: (n,) as the compiled model has them.
        channels: (2, 3) where the channels of A and B end, m.
    """

    def __init__(self, design: Concentric) -> None:
        """Build it; raises ``MeaninglessTubes``."""
        self.tubes = tube_array(design.tubes)
        self.count = len(self.tubes)
        half = 0.5e-3 * design.channel_spacing_mm
        self.channels = np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]])

    def evaluate(self, out: PairKinematics, guess: np.ndarray) -> int:
        """Fill everything of ``out`` from its ``q``.

        Args:
            out: filled; only its ``q`` is read.
            guess: (2n,) torsion rates near by, so that the branch is followed; may be
                ``out.torsion`` itself. From its own torsion a configuration evaluates to the same
                bits again.

        Returns:
            ``robot.concentric.kinematics.SOLVED``, or why an arm was not solved: ``out`` is then of
            no use.
        """
        n, size = self.count, 2 * self.count
        for arm in range(2):
            torsion = slice(n * arm, n * (arm + 1))
            status = solve_arm(
                out.q[size * arm : size * (arm + 1)],
                guess[torsion],
                self.tubes,
                out.position[arm],
                out.rotation[arm],
                out.jacobian[arm],
                out.torsion[torsion],
                out.torsion_change[arm],
                out.stability[arm : arm + 1],
            )
            if status != SOLVED:
                return int(status)
            out.position[arm] += self.channels[arm]
        np.subtract(out.position[1], out.position[0], out=out.relative)
        np.negative(out.jacobian[0, :3], out=out.relative_jacobian[:, :size])
        out.relative_jacobian[:, size:] = out.jacobian[1, :3]
        out.tracking_jacobian[:, :size] = out.jacobian[0, :3]
        return SOLVED

    def evaluate_cold(self, out: PairKinematics) -> int:
        """Like :meth:`evaluate` where nothing is known of the torsion; slower."""
        n = self.count
        guess = np.zeros(2 * n)
        for arm in range(2):
            own = out.q[2 * n * arm : 2 * n * (arm + 1)]
            status = solve_cold(own, self.tubes, guess[n * arm : n * (arm + 1)])
            if status != SOLVED:
                return int(status)
        return self.evaluate(out, guess)

    def guess_after(self, now: PairKinematics, q: np.ndarray, guess: np.ndarray) -> None:
        """Fill ``guess`` (2n,) with the torsion rates at ``q`` (4n,), to first order."""
        n, size = self.count, 2 * self.count
        for arm in range(2):
            own = slice(size * arm, size * (arm + 1))
            change = now.torsion_change[arm] @ (q[own] - now.q[own])
            guess[n * arm : n * (arm + 1)] = now.torsion[n * arm : n * (arm + 1)] + change


def start_of(start: ConcentricStart) -> np.ndarray:
    """q_AB (4n,) in m and rad of a start of the configuration."""
    return np.concatenate(
        [
            np.array(start.translations_a_mm) * 1e-3,
            np.radians(start.rotations_a_deg),
            np.array(start.translations_b_mm) * 1e-3,
            np.radians(start.rotations_b_deg),
        ]
    )
