"""The boards, by name."""

from __future__ import annotations

from collections.abc import Callable

from robot.configuration import Configuration
from robot.errors import UnknownName
from scenes.boards.pegboard import pegboard
from scenes.boards.ring_board import ring_board
from scenes.boards.silicon import silicon
from scenes.boards.solids import Ball, Board, Groove, Ring, Solid

__all__ = ["BOARD_NAMES", "Ball", "Board", "Groove", "Ring", "Solid", "board"]

_BOARDS: dict[str, Callable[[Configuration], Board]] = {
    "none": lambda _: Board("none", "No board"),
    "pegboard": pegboard,
    "silicon-sine": lambda configuration: silicon(
        "silicon-sine", "Silicon board: sine groove, 5 cm long", configuration
    ),
    "silicon-arc": lambda configuration: silicon(
        "silicon-arc", "Silicon board: arc groove, 2 cm radius", configuration
    ),
    "ring-board": ring_board,
}

BOARD_NAMES = tuple(_BOARDS)
"""The names that :func:`board` knows."""


def board(name: str, configuration: Configuration) -> Board:
    """The board called ``name``, placed before the tip as it is at the configured start.

    Raises:
        UnknownName: there is no such board.
    """
    if name not in _BOARDS:
        raise UnknownName("board", name, BOARD_NAMES)
    return _BOARDS[name](configuration)
