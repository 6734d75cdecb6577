"""Parts of the instrument's records that belong to sensing."""

from __future__ import annotations

import numpy as np

SENSED = np.dtype(
    [
        ("time", "f8"),
        ("shaft_position", "f8", 3),
        ("shaft_wxyz", "f8", 4),
        ("servo", "f8", 4),
        ("tension", "f8", 4),
    ]
)
"""What was measured at one time (s, on the state's own clock), kept until the tracker's sample of
that time arrives: where the shaft ends (base frame, m), servos rad, tensions N."""

SENSED_COUNT = 16

CURVATURE_MODES = 11
"""Of the estimated shape: see ``robot.sensing.curvature_modes``."""
