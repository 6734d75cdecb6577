"""What the drives of the tendons hold, and what the state of the instrument remembers of it."""

from __future__ import annotations

from enum import IntEnum
from typing import Any


class TendonControl(IntEnum):
    """What the drives of the four tendons hold: lengths; a length and a tension in each opposed
    pair; tensions. The last two need torque cells (``robot.tension.tendon_command``).
    """

    POSITION = 0
    HYBRID = 1
    TENSION = 2


class TendonMode(IntEnum):
    """What the drive of one tendon holds."""

    POSITION = 0
    TENSION = 1


TENDON_SETTINGS: list[Any] = [("tendon_control", "i8"), ("co_contraction", "f8")]
"""Of the operator: a :class:`TendonControl`, and the tension in N that no tendon falls below where
tensions are held."""

TENDON_COMMAND: list[Any] = [("tendon_mode", "i8", 4), ("tension", "f8", 4)]
"""To the drives: a tendon whose mode is ``TendonMode.TENSION`` is to be held at ``tension`` (N);
the servo angle beside it then is the one to expect."""

TENDON_STATE: list[Any] = [
    ("tendon_map", "i8"),
    ("tendon_mode", "i8", 4),
    ("tendon_holder", "i8", 2),
    ("tendon_servo", "f8", 4),
    ("tendon_bias", "f8", 4),
    ("tendon_tension", "f8", 4),
    ("force_bias", "f8", 2),
    ("cell_read", "f8", 4),
    ("cell_same", "f8", 4),
]
"""``tendon_servo`` (rad), ``tendon_mode``, ``tendon_tension`` (N): what the last command told the
drives; ``tendon_map``, ``tendon_holder``, ``tendon_bias`` (rad), ``force_bias`` (N m): see
``robot.tension.tendon_command``; ``cell_read`` (N), ``cell_same`` (s): ``robot.tension.cells``."""
