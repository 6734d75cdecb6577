"""Why an estimate of shape and force is not valid."""

from __future__ import annotations

from enum import IntEnum


class SensingFault(IntEnum):
    """What is wrong with an estimate; NONE while it is valid."""

    NONE = 0
    OFF = 1
    NO_TENSION_CELLS = 2
    CELL_MISSING = 3
    CELL_SATURATED = 4
    TENDON_BROKEN = 5
    TRACKER_LOST = 6
    POSE_IMPOSSIBLE = 7
    NOT_CONVERGED = 8
    CELL_FLAT = 9


REASONS = {
    SensingFault.NONE: ("valid", ""),
    SensingFault.OFF: ("sensing is off", "switch it on under Sensing"),
    SensingFault.NO_TENSION_CELLS: (
        "this robot measures no tendon tension",
        "choose the plant with the tension-feedback unit",
    ),
    SensingFault.CELL_MISSING: (
        "a torque cell gives no reading",
        "check its cable and its amplifier",
    ),
    SensingFault.CELL_SATURATED: (
        "a torque cell is at the end of its range",
        "lower the tension",
    ),
    SensingFault.CELL_FLAT: (
        "the reading of a torque cell does not change any more",
        "check its amplifier, or switch the unit off and on",
    ),
    SensingFault.TENDON_BROKEN: (
        "a tendon carries no tension although it is pulled",
        "disable, and look whether it is broken or has come off its pulley",
    ),
    SensingFault.TRACKER_LOST: (
        "the tracker gives no recent pose of the tip",
        "bring its marker back into view",
    ),
    SensingFault.POSE_IMPOSSIBLE: (
        "no bend of the segment gives the measured pose of the tip",
        "check the tracker's registration and its marker",
    ),
    SensingFault.NOT_CONVERGED: (
        "the estimate did not settle",
        "check tracker, tensions and calibration against each other",
    ),
}
"""What people read of each fault, and what to do about it."""
