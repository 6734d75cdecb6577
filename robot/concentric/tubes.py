"""The tubes as compiled code reads them, and which configurations of them mean something.

A configuration of n tubes is q = (β_1 .. β_n, α_1 .. α_n): β_i, in m, is where the rear end of
tube i stands before the channel's exit (s = 0, so β_i ≤ 0), α_i, in rad, how far it is turned
there. The first tube is the innermost and the longest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robot.concentric.design import TubeDesign
from robot.errors import KeyholeError

TUBE = np.dtype(
    [
        ("length", "f8"),
        ("straight_length", "f8"),
        ("curvature", "f8"),
        ("bending_stiffness", "f8"),
        ("torsional_stiffness", "f8"),
    ]
)
"""One tube: whole length and length of its straight rear part in m, curvature of its front part in
1/m, EI and GJ in N·m²."""

MOST_TUBES = 6

ROUNDING = 1e-9
"""How far (m) a translation may be beyond (1) by arithmetic alone."""


class MeaninglessTubes(KeyholeError):
    """Tubes that the model cannot describe.

    Attributes:
        number: of the tube, from 1 at the innermost; 0 where all of them are meant.
    """

    code = "meaningless_tubes"

    def __init__(self, number: int, detail: str) -> None:
        where = f"tube {number}" if number else "the tubes"
        super().__init__(f"{where}: {detail}; change [[concentric.tubes]]")
        self.number = number


class InvalidTubeConfiguration(KeyholeError):
    """A configuration of the wrong size, or with NaN or infinity in it.

    Attributes:
        tube_count: how many tubes it should be for.
    """

    code = "invalid_tube_configuration"

    def __init__(self, tube_count: int, detail: str) -> None:
        super().__init__(
            f"configuration of {tube_count} tubes: {detail}; give {tube_count} translations, then "
            f"{tube_count} rotations, all finite"
        )
        self.tube_count = tube_count


class TubeOutOfBounds(KeyholeError):
    """A translation lies outside the proximal constraint, paper 2, eq. (1).

    Attributes:
        number: of the tube, from 1 at the innermost.
        translation_mm: the refused translation.
        bound_mm: the bound that it is beyond.
        reason: what the bound stands for.
    """

    code = "tube_out_of_bounds"

    def __init__(
        self, number: int, translation_mm: float, side: str, bound_mm: float, reason: str
    ) -> None:
        super().__init__(
            f"tube {number} at {translation_mm:.3f} mm is {side} {bound_mm:.3f} mm, where "
            f"{reason}; move it back to {bound_mm:.3f} mm"
        )
        self.number, self.translation_mm = number, translation_mm
        self.bound_mm, self.reason = bound_mm, reason


def bending_stiffness(design: TubeDesign) -> float:
    """EI in N·m²: Young's modulus times π/64 (outer⁴ − inner⁴)."""
    outer, inner = design.outer_diameter_mm * 1e-3, design.inner_diameter_mm * 1e-3
    return design.youngs_modulus_gpa * 1e9 * math.pi / 64.0 * (outer**4 - inner**4)


def tube_array(designs: Sequence[TubeDesign]) -> np.ndarray:
    """The (n,) read-only ``TUBE`` array of ``designs``, innermost first.

    Raises:
        MeaninglessTubes: none, too many, without a wall or a length, or not longer than the tube
            around it.
    """
    if not 1 <= len(designs) <= MOST_TUBES:
        raise MeaninglessTubes(0, f"there are {len(designs)}, the model takes 1 to {MOST_TUBES}")
    tubes = np.zeros(len(designs), TUBE)
    for index, design in enumerate(designs):
        stiffness = bending_stiffness(design)
        if not (stiffness > 0.0 and design.length_mm > 0.0 and design.stiffness_ratio > 0.0):
            raise MeaninglessTubes(index + 1, "it needs a wall, a length and a stiffness above 0")
        if index and designs[index - 1].length_mm <= design.length_mm:
            raise MeaninglessTubes(
                index,
                f"{designs[index - 1].length_mm:g} mm long, no longer than tube {index + 1} around "
                f"it ({design.length_mm:g} mm)",
            )
        tubes[index] = (
            design.length_mm * 1e-3,
            design.straight_length_mm * 1e-3,
            design.curvature_per_m,
            stiffness,
            stiffness / design.stiffness_ratio,
        )
    tubes.flags.writeable = False
    return tubes


def translation_bounds(
    translations: np.ndarray, tubes: np.ndarray, index: int
) -> list[tuple[str, float, str]]:
    """The bounds of paper 2, eq. (1), on tube ``index`` (from 0): side, bound in m, reason."""
    bounds = [
        ("below", -float(tubes["length"][index]), "its tip is at the channel's exit"),
        ("above", 0.0, "its rear end is at the channel's exit"),
    ]
    if index:
        inner = float(translations[index - 1])
        longer = float(tubes["length"][index - 1] - tubes["length"][index])
        bounds += [
            ("below", inner, f"its rear end meets that of tube {index} inside it"),
            ("above", inner + longer, f"its tip meets that of tube {index} inside it"),
        ]
    return bounds


def check_configuration(q: np.ndarray, tubes: np.ndarray) -> None:
    """Refuse a configuration outside paper 2, eq. (1), without margins.

    Args:
        q: (2n,) translations in m, then rotations in rad.
        tubes: (n,) ``TUBE``.

    Raises:
        InvalidTubeConfiguration: wrong size, NaN or infinity.
        TubeOutOfBounds: a translation is beyond one of its bounds.
    """
    count = len(tubes)
    if np.shape(q) != (2 * count,):
        raise InvalidTubeConfiguration(count, f"the shape is {np.shape(q)}")
    if not np.all(np.isfinite(q)):
        raise InvalidTubeConfiguration(
            count, f"value {int(np.argmin(np.isfinite(q))) + 1} is not finite"
        )
    for index in range(count):
        for side, bound, reason in translation_bounds(q[:count], tubes, index):
            beyond = bound - q[index] if side == "below" else q[index] - bound
            if beyond > ROUNDING:
                raise TubeOutOfBounds(index + 1, float(q[index]) * 1e3, side, bound * 1e3, reason)
