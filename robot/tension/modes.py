"""Hybrid control: which tendons may hold a tension while the others hold a length.

A tendon that holds its tension has no stiffness of its own, so the stiffness of the degrees of
freedom is

    K = backbone + sum_i tau_i d2q_i/dx2 + (A diag(k) A^T over the tendons that hold a length),

which must be positive in every direction. All in tension mode is therefore allowed on an elastic
backbone, which holds itself, and refused on a jointed instrument, which nothing holds. The other
way round, the co-contraction in :func:`uncommanded_co_contraction` dimensions is left to chance
(to how the tendons were strung) where too few are in tension mode. With m = n + redundancy, n
tendons in position mode and the redundancy in tension mode do both, if they are the right ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robot.errors import KeyholeError
from robot.tension.records import TendonMode
from robot.tension.structures import Structure

_HELD = 1e-9
_RANK_TOLERANCE = 1e-9


class UncontrolledPosition(KeyholeError):
    """With these modes a direction of the degrees of freedom is held by nothing.

    Attributes:
        modes: (m,) the modes asked for.
        direction: (n,) the least held direction, of length 1.
        stiffness: along it.
    """

    code = "uncontrolled_position"

    def __init__(
        self,
        structure: Structure,
        modes: tuple[TendonMode, ...],
        direction: np.ndarray,
        stiffness: float,
    ) -> None:
        free = structure.freedoms[int(np.argmax(np.abs(direction)))]
        super().__init__(
            f"{structure.name}: nothing holds {free} (stiffness {stiffness:.3g}) with "
            f"{', '.join(mode.name.lower() for mode in modes)}; put a tendon that moves it into "
            "position mode"
        )
        self.modes, self.direction, self.stiffness = modes, direction, stiffness


def check_modes(
    structure: Structure,
    modes: Sequence[TendonMode],
    tendon_stiffness: np.ndarray,
    elastic: np.ndarray | None = None,
) -> None:
    """Refuse modes that leave a degree of freedom to itself.

    Args:
        structure: of the instrument.
        modes: (m,).
        tendon_stiffness: (m,) of tendon and drive in position mode, N/m.
        elastic: (n, n) stiffness without any tendon's own: backbone, and what tensions add to it;
            None for an instrument of joints that nothing else holds.

    Raises:
        UncontrolledPosition: the stiffness is not positive in every direction.
    """
    holding = np.array([mode == TendonMode.POSITION for mode in modes]) * tendon_stiffness
    stiffness = (structure.matrix * holding) @ structure.matrix.T
    largest = (structure.matrix * tendon_stiffness) @ structure.matrix.T
    if elastic is not None:
        stiffness = stiffness + elastic
    values, directions = np.linalg.eigh(stiffness)
    if values[0] <= _HELD * float(np.linalg.norm(largest, 2)):
        raise UncontrolledPosition(structure, tuple(modes), directions[:, 0], float(values[0]))


def uncommanded_co_contraction(structure: Structure, modes: Sequence[TendonMode]) -> int:
    """Dimensions of co-contraction that no tendon in tension mode sets."""
    seen = structure.null_space()[[mode == TendonMode.TENSION for mode in modes]]
    rank = np.linalg.matrix_rank(seen, tol=_RANK_TOLERANCE) if seen.size else 0
    return structure.redundancy - int(rank)
