"""Which numpy types the records of a configuration's robot have."""

from __future__ import annotations

from robot.concentric.records import concentric_types
from robot.configuration import Configuration
from robot.records import INSTRUMENT, RecordTypes


def record_types_of(configuration: Configuration) -> RecordTypes:
    """The types of the robot that ``configuration`` chooses."""
    if configuration.robot == "concentric":
        return concentric_types(len(configuration.concentric.tubes))
    return INSTRUMENT
