"""What one tick of the concentric-tube arms takes and gives, as numpy record types.

SI units, base frame on the endoscope's face. An arm of n tubes has the axes
q = [beta_1 .. beta_n, alpha_1 .. alpha_n] in m and rad, the innermost tube first; both arms
together have [q_A, q_B], (4 n,). The led tip of the shared fields is A's.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from robot.records import (
    SHARED_INPUT,
    SHARED_REPORT,
    SHARED_SETTINGS,
    SHARED_STATE,
    SHARED_TRUTH,
    RecordTypes,
    record_types,
)

SETTINGS = np.dtype([*SHARED_SETTINGS, ("method", "i8")])
"""``method``: place of the method among ``robot.concentric.design.METHODS``."""


@cache
def concentric_types(tubes: int) -> RecordTypes:
    """The types of two arms of ``tubes`` tubes each."""
    axes = 4 * tubes
    tick_input = np.dtype([*SHARED_INPUT, ("settings", SETTINGS), ("measured_q", "f8", axes)])
    state = np.dtype(
        [
            *SHARED_STATE,
            ("q", "f8", axes),
            ("torsion", "f8", 2 * tubes),
            ("position_b", "f8", 3),
            ("rotation_b", "f8", (3, 3)),
            ("relative_position", "f8", 3),
            ("relative_allowance", "f8"),
        ]
    )
    command = np.dtype([("q", "f8", axes), ("moving", "i8")])
    report = np.dtype(
        [
            *SHARED_REPORT,
            ("q", "f8", axes),
            ("q_dot", "f8", axes),
            ("position_b", "f8", 3),
            ("wxyz_b", "f8", 4),
            ("desired_b", "f8", 3),
            ("bound_lower", "f8", 2 * tubes),
            ("bound_upper", "f8", 2 * tubes),
            ("relative_error", "f8"),
            ("task_scale", "f8", 2),
            ("stability", "f8", 2),
        ]
    )
    truth = np.dtype(
        [
            *SHARED_TRUTH,
            ("q", "f8", axes),
            ("torsion", "f8", 2 * tubes),
            ("position_b", "f8", 3),
            ("wxyz_b", "f8", 4),
            ("relative_error", "f8"),
        ]
    )
    outcome = np.dtype([("state", state), ("command", command), ("report", report)])
    return record_types("concentric", tick_input, outcome, truth)


# Fields: ``q``, ``torsion`` (base torsion rates, rad/m): both arms, A first; ``relative_position``:
# of B's tip from A's that B keeps; ``relative_allowance``: the relative error above which motion
# pauses; ``desired_b``: where B's tip shall be; ``bound_*``: between which each tube may be
# translated now, eq. (1) with its margins; ``relative_error``: distance of B's tip from its place,
# m; ``task_scale``: share of the relative and of the tracking task that the method carried out;
# ``stability``: determinant of each arm, 1 far from snapping, 0 where it snaps.
