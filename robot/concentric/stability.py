"""When tubes snap, and whether they do on the way from one configuration to another.

The torsion rates ω at the exit determine the torsion rates r at the tubes' ends, which are zero in
equilibrium. The stability determinant is det(∂r/∂ω) with the tubes' rear ends held. It is 1 where
tubes do not twist each other, above 1 where aligned tubes hold each other, and it falls to 0 where
neighbouring equilibria meet: there the tubes leave one and swing to another (Gilbert, Hendrick &
Webster 2016, "Elastic stability of concentric tube robots"; the same determinant is that of the
angles at the rear ends by those at the tips, since the equations of both are adjoint).

For two tubes that overlap over a length ℓ, opposite each other, it is
cos(√k ℓ) − (c_1 b_1 + c_2 b_2) sin(√k ℓ) / √k, with b_i the length of tube i that twists between
its rear end and the overlap, c_i = EI_1 κ_1 EI_2 κ_2 / (ΣEI GJ_i) and k = c_1 + c_2.

A positive determinant at one pose is necessary, not sufficient: two unstable modes at once make it
positive again. So its sign is followed from where it is known: along the coupling
(:func:`robot.concentric.kinematics.solve_cold`) and then along a path (:func:`first_snap`).
"""

from __future__ import annotations

import math

import numpy as np

from robot.concentric.kinematics import SOLVED, solve_arm, solve_cold
from robot.concentric.tubes import check_configuration
from robot.errors import KeyholeError

_LONGEST_STEP = 0.02
_LARGEST_FALL = 0.5
_LARGEST_SURPRISE = 0.1


class TubesSnap(KeyholeError):
    """The tubes cannot rest in a configuration.

    Attributes:
        q: (2n,) the configuration.
    """

    code = "tubes_snap"

    def __init__(self, q: np.ndarray) -> None:
        degrees = ", ".join(f"{math.degrees(angle):.0f}" for angle in q[len(q) // 2 :])
        super().__init__(
            f"tubes turned to {degrees} degrees cannot rest opposite each other over so long an "
            "overlap; turn them closer to each other or draw one back"
        )
        self.q = q.copy()


class BranchFollower:
    """A stable solution that is followed from configuration to configuration.

    Attributes:
        q: (2n,) where it stands, m and rad.
        torsion: (n,) torsion rates at the exit there, rad/m.
        determinant: the stability determinant there; above 0.
    """

    def __init__(self, q: np.ndarray, tubes: np.ndarray) -> None:
        """Stand at ``q`` (2n,).

        Raises:
            InvalidTubeConfiguration, TubeOutOfBounds: outside paper 2, eq. (1).
            TubesSnap: nothing stable is there.
        """
        check_configuration(q, tubes)
        count = len(tubes)
        self._tubes = tubes
        self._outputs = np.empty(3), np.empty((3, 3)), np.empty((6, 2 * count))
        self._torsion, self._change = np.empty(count), np.empty((count, 2 * count))
        self._determinant = np.empty(1)
        self.q, self.torsion = q.copy(), np.empty(count)
        if solve_cold(q, tubes, self.torsion) != SOLVED or self._solve(q, self.torsion) != SOLVED:
            raise TubesSnap(q)
        self._keep(q)

    def _solve(self, q: np.ndarray, guess: np.ndarray) -> int:
        outputs = (*self._outputs, self._torsion, self._change, self._determinant)
        return solve_arm(q, guess, self._tubes, *outputs)

    def _keep(self, q: np.ndarray) -> None:
        self.q, self.torsion = q.copy(), self._torsion.copy()
        self.torsion_change = self._change.copy()
        self.determinant = float(self._determinant[0])

    def step(self, q: np.ndarray) -> bool:
        """Go to ``q`` (2n,) nearby; stay, and say False, if the branch cannot be recognised there.

        It is recognised where the determinant does not fall to less than half and the torsion is
        where its derivative says.
        """
        guess = self.torsion + self.torsion_change @ (q - self.q)
        if self._solve(q, guess) != SOLVED:
            return False
        surprise = float(np.max(np.abs(self._torsion - guess)))
        if not self._determinant[0] > _LARGEST_FALL * self.determinant:
            return False
        if surprise > _LARGEST_SURPRISE:
            return False
        self._keep(q)
        return True


def first_snap(
    q0: np.ndarray, q1: np.ndarray, tubes: np.ndarray, resolution: float = 1e-6
) -> float | None:
    """Where the tubes snap on the straight line from ``q0`` to ``q1``, if they do.

    Near a snap the steps grow shorter, since the determinant may only halve in each.

    Args:
        q0: (2n,) where the motion begins, m and rad.
        q1: (2n,) where it should end.
        tubes: (n,) ``TUBE``.
        resolution: fraction of the line to which the snap is found.

    Returns:
        The fraction of the line, 0 to 1; 0 where nothing stable is at ``q0``; None without a snap.

    Raises:
        InvalidTubeConfiguration, TubeOutOfBounds: ``q0`` or ``q1`` is outside paper 2, eq. (1).
    """
    check_configuration(q0, tubes)
    check_configuration(q1, tubes)
    try:
        follower = BranchFollower(q0, tubes)
    except TubesSnap:
        return 0.0
    fraction, step = 0.0, _LONGEST_STEP
    while fraction < 1.0:
        ahead = min(fraction + step, 1.0)
        if follower.step(q0 + ahead * (q1 - q0)):
            fraction = ahead
            step = min(2.0 * step, _LONGEST_STEP)
        else:
            step *= 0.5
            if step < resolution:
                return fraction
    return None
