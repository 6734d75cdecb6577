"""Structure matrices: what the actuators of an instrument do to its degrees of freedom.

The generalised force on the degrees of freedom x is ``matrix @ tau``, tau being the tensions (N) at
the base. By virtual work the matrix is -J_q^T, with J_q = dq/dx of the length changes q (paper 3,
eq. (41) with the sign that its q needs). A tendon at azimuth a about a segment's axis changes by
q = -r (u cos a - v sin a), so its column in (u, v) is r (cos a, -sin a).

The unit has four motors and drives instruments of two to four degrees of freedom (paper 3, II-A).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.errors import KeyholeError

_RANK_TOLERANCE = 1e-9


class StructureRefused(KeyholeError):
    """A structure matrix, or the names that belong to it, cannot be used.

    Attributes:
        structure: name of the structure.
    """

    code = "structure_refused"

    def __init__(self, structure: str, detail: str) -> None:
        super().__init__(f"structure {structure!r}: {detail}")
        self.structure = structure


@dataclass(frozen=True, eq=False)
class Structure:
    """How m actuators load n degrees of freedom; raises StructureRefused where that is senseless.

    Attributes:
        name: of the structure.
        matrix: (n, m) generalised force per tension: N m per N for an angle, N per N for a length.
        pull_only: (m,) True for a tendon; False for a rod that also pushes.
        freedoms: (n,) names of the degrees of freedom.
        actuators: (m,) names of the actuators.
    """

    name: str
    matrix: np.ndarray
    pull_only: np.ndarray
    freedoms: tuple[str, ...]
    actuators: tuple[str, ...]

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=float)
        pull_only = np.array(self.pull_only, dtype=bool)
        if matrix.ndim != 2 or not matrix.size or not np.isfinite(matrix).all():
            raise StructureRefused(self.name, "the matrix must be two-dimensional and finite")
        if matrix.shape != (len(self.freedoms), len(self.actuators)):
            raise StructureRefused(
                self.name, f"a {matrix.shape} matrix does not fit the names of its rows and columns"
            )
        if pull_only.shape != (matrix.shape[1],):
            raise StructureRefused(self.name, "pull_only needs one entry for each actuator")
        for array in (matrix, pull_only):
            array.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "pull_only", pull_only)

    @property
    def rank(self) -> int:
        """How many independent generalised forces the actuators give."""
        return int(np.linalg.matrix_rank(self.matrix, rtol=_RANK_TOLERANCE))

    @property
    def redundancy(self) -> int:
        """Actuators beyond the rank: dimension of the tensions that cancel each other."""
        return len(self.actuators) - self.rank

    def null_space(self) -> np.ndarray:
        """(m, redundancy) orthonormal tensions that give no generalised force."""
        return np.linalg.svd(self.matrix)[2][self.rank :].T


def _columns(azimuths: np.ndarray, pitch_radius: float) -> np.ndarray:
    """(2, len(azimuths)) columns in (u, v) of tendons at these azimuths (rad)."""
    return pitch_radius * np.stack([np.cos(azimuths), -np.sin(azimuths)])


def four_tendons(pitch_radius: float) -> Structure:
    """A segment bent in (u, v) by four tendons 90 degrees apart: redundancy 2.

    The instrument of paper 3's experiments and of this console. Each opposed pair can be tightened
    by itself.

    Args:
        pitch_radius: distance of the tendons from the axis, m.
    """
    matrix = pitch_radius * np.array([[1.0, 0.0, -1.0, 0.0], [0.0, -1.0, 0.0, 1.0]])
    names = ("tendon 1", "tendon 2", "tendon 3", "tendon 4")
    return Structure("four tendons", matrix, np.ones(4, dtype=bool), ("u", "v"), names)


def three_tendons(pitch_radius: float) -> Structure:
    """A segment bent in (u, v) by three tendons 120 degrees apart: redundancy 1.

    A thin two-DoF instrument with the fewest tendons that can pull it every way; only all three
    together can be tightened.

    Args:
        pitch_radius: distance of the tendons from the axis, m.
    """
    azimuths = np.arange(3) * (2.0 * math.pi / 3.0)
    names = ("tendon 1", "tendon 2", "tendon 3")
    matrix = _columns(azimuths, pitch_radius)
    return Structure("three tendons", matrix, np.ones(3, dtype=bool), ("u", "v"), names)


def three_tendons_and_rod(pitch_radius: float, jaw_lever: float) -> Structure:
    """A gripper on a segment with three tendons, its jaw moved by a rod: 3 DoF, redundancy 1.

    The push-pull rod runs along the axis, where bending does not change its length, and turns the
    jaw by a lever. All four motors are used.

    Args:
        pitch_radius: distance of the tendons from the axis, m.
        jaw_lever: moment arm of the rod about the jaw's pin, m; pulling closes.
    """
    bend = three_tendons(pitch_radius)
    matrix = np.zeros((3, 4))
    matrix[:2, :3] = bend.matrix
    matrix[2, 3] = jaw_lever
    return Structure(
        "three tendons and a rod",
        matrix,
        np.array([True, True, True, False]),
        (*bend.freedoms, "jaw"),
        (*bend.actuators, "rod"),
    )


def four_rods(pitch_radius: float) -> Structure:
    """Two segments in series bent by four push-pull rods: 4 DoF, redundancy 0.

    Two rods, at 0 and 90 degrees, end at the proximal segment; two, at 45 and 135 degrees, run on
    through it to the distal one and therefore load both. With as many rods as degrees of freedom no
    force is left to choose, and the stiffness cannot be modulated.

    Args:
        pitch_radius: distance of the rods from the axis, m.
    """
    azimuths = np.radians([0.0, 90.0, 45.0, 135.0])
    matrix = np.zeros((4, 4))
    matrix[:2] = _columns(azimuths, pitch_radius)
    matrix[2:, 2:] = matrix[:2, 2:]
    return Structure(
        "four rods",
        matrix,
        np.zeros(4, dtype=bool),
        ("proximal u", "proximal v", "distal u", "distal v"),
        ("proximal rod 1", "proximal rod 2", "distal rod 1", "distal rod 2"),
    )
