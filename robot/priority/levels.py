"""Levels: which task rows matter before which.

A level is a selection of rows of the catalogue (``robot.instrument``). Cases 0, 1 and 2 of the
paper and *pointing* are presets; any other selection can be written down the same way. Paper 1,
section 2.4 and Table 5; case 0 puts the RCM first, as the table has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robot.compiled import compiled
from robot.errors import UnknownName
from robot.instrument import LAMBDA_ROWS, LINEAR_ROWS, POINTING_ROWS, RCM_ROWS, ROLL_ROWS
from robot.records import Case

ROW_SETS: dict[str, tuple[int, ...]] = {
    "rcm": tuple(RCM_ROWS),
    "linear": tuple(LINEAR_ROWS),
    "x": (LINEAR_ROWS[0],),
    "y": (LINEAR_ROWS[1],),
    "z": (LINEAR_ROWS[2],),
    "pointing": tuple(POINTING_ROWS),
    "roll": tuple(ROLL_ROWS),
    "angular": tuple(POINTING_ROWS) + tuple(ROLL_ROWS),
    "lambda": tuple(LAMBDA_ROWS),
}
"""What a level may select: linear directions in the base frame, angular ones in the tip frame."""

Level = tuple[str, ...]

PRESETS: dict[Case, tuple[Level, ...]] = {
    Case.BALANCED: (("rcm",), ("linear", "angular")),
    Case.LINEAR_FIRST: (("rcm",), ("linear",), ("angular",)),
    Case.ANGULAR_FIRST: (("rcm",), ("angular",), ("linear",)),
    Case.POINTING: (("rcm",), ("linear",), ("pointing",)),
}
"""Below the RCM: everything together; position, then orientation; the reverse; position, then the
direction of the tip's axis, with roll released.

None of these leaves lambda free. Trocar, tip and the tip's axis lie in the bending plane, and
inside that plane shaft angle, insertion and bend are as many unknowns as position and direction are
equations. Releasing roll lets shaft roll and bending direction turn against each other, which moves
nothing along the shaft. Lambda can be steered by a plan that releases a direction of position or
pointing, with ``lambda`` as a level of its own.
"""

CASE_NAMES: dict[str, Case] = {
    "0": Case.BALANCED,
    "1": Case.LINEAR_FIRST,
    "2": Case.ANGULAR_FIRST,
    "pointing": Case.POINTING,
}


def case_named(name: str) -> Case:
    """The preset called ``name``; raises :class:`robot.errors.UnknownName`."""
    try:
        return CASE_NAMES[name]
    except KeyError:
        raise UnknownName("priority case", name, tuple(CASE_NAMES)) from None


class Span(NamedTuple):
    """Rows ``start`` to ``stop`` of a plan form one level."""

    start: int
    stop: int


@dataclass(frozen=True)
class Plan:
    """Levels resolved to rows of the catalogue.

    Attributes:
        rows: (m,) catalogue rows in order of priority.
        weights: (m,) factor of each row inside its level.
        starts: (levels + 1,) first plan row of each level, and m.
    """

    rows: np.ndarray
    weights: np.ndarray
    starts: np.ndarray

    def spans(self) -> tuple[Span, ...]:
        """The levels as ranges of plan rows."""
        return tuple(
            Span(int(a), int(b)) for a, b in zip(self.starts[:-1], self.starts[1:], strict=True)
        )


def plan(levels: tuple[Level, ...], characteristic_length: float) -> Plan:
    """Resolve ``levels``.

    Args:
        levels: names of row sets, level by level.
        characteristic_length: weighs an angular row (rad) that shares a level with linear rows (m),
            in m.

    Raises:
        UnknownName: a row set that does not exist, or a row that is selected twice.
    """
    rows: list[int] = []
    weights: list[float] = []
    starts = [0]
    angular = set(ROW_SETS["angular"])
    for level in levels:
        selected: list[int] = []
        for name in level:
            if name not in ROW_SETS:
                raise UnknownName("row set", name, tuple(ROW_SETS))
            selected.extend(ROW_SETS[name])
        if set(selected) & set(rows) or len(set(selected)) != len(selected):
            raise UnknownName("row set used only once", "+".join(level), tuple(ROW_SETS))
        mixed = bool(set(selected) & angular) and not set(selected) <= angular
        rows.extend(selected)
        weights.extend(
            characteristic_length if mixed and row in angular else 1.0 for row in selected
        )
        starts.append(len(rows))
    return Plan(np.array(rows), np.array(weights), np.array(starts))


@compiled
def _rotate_rows(matrix: np.ndarray, target: np.ndarray, i: int, j: int, tangent: float) -> None:
    cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
    sine = tangent * cosine
    for k in range(matrix.shape[1]):
        a, b = matrix[i, k], matrix[j, k]
        matrix[i, k] = cosine * a + sine * b
        matrix[j, k] = cosine * b - sine * a
    a, b = target[i], target[j]
    target[i] = cosine * a + sine * b
    target[j] = cosine * b - sine * a


@compiled
def equalize(matrix: np.ndarray, target: np.ndarray) -> None:
    """Turn the rows of a level among themselves until all have the same norm, in place.

    The QP solver normalises constraint rows, so in a level that cannot be met it minimises the sum
    of (residual / row norm)^2. With equal norms that is the residual itself, and an orthogonal turn
    of the rows does not change the residual's norm.

    Args:
        matrix: (m, n) rows of the level.
        target: (m,) their right-hand sides.
    """
    rows = matrix.shape[0]
    squares = np.empty(rows)
    for i in range(rows):
        squares[i] = 0.0
        for k in range(matrix.shape[1]):
            squares[i] += matrix[i, k] * matrix[i, k]
    mean = squares.sum() / rows
    for i in range(rows - 1):
        excess = squares[i] - mean
        other = -1
        best = 1e-12 * mean
        if abs(excess) <= best:
            continue
        for j in range(i + 1, rows):
            opposite = mean - squares[j] if excess > 0.0 else squares[j] - mean
            if opposite > best:
                best = opposite
                other = j
        if other < 0:
            continue
        a = squares[other] - mean
        product = 0.0
        for k in range(matrix.shape[1]):
            product += matrix[i, k] * matrix[other, k]
        root = np.sqrt(max(product * product - a * excess, 0.0))
        # The smaller root of a t^2 + 2 product t + excess = 0, without cancellation.
        tangent = -excess / (product + root) if product >= 0.0 else -excess / (product - root)
        _rotate_rows(matrix, target, i, other, tangent)
        squares[other] = squares[i] + squares[other] - mean
        squares[i] = mean


@compiled
def assemble(
    catalogue: np.ndarray,
    targets: np.ndarray,
    rows: np.ndarray,
    weights: np.ndarray,
    starts: np.ndarray,
    matrix: np.ndarray,
    target: np.ndarray,
) -> None:
    """Copy the plan's rows out of the catalogue, weigh them, and equalise each level.

    Args:
        catalogue: (10, 10) all task rows.
        targets: (10,) their wanted rates.
        rows: (m,) of the plan.
        weights: (m,) of the plan.
        starts: (levels + 1,) of the plan.
        matrix: (m, 10) filled.
        target: (m,) filled.
    """
    for r in range(rows.size):
        for k in range(10):
            matrix[r, k] = weights[r] * catalogue[rows[r], k]
        target[r] = weights[r] * targets[rows[r]]
    for level in range(starts.size - 1):
        equalize(
            matrix[starts[level] : starts[level + 1]], target[starts[level] : starts[level + 1]]
        )
