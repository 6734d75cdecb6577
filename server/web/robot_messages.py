"""Which state messages belong to a configuration's robot."""

from __future__ import annotations

from robot.configuration import Configuration
from server.web.concentric_message import ConcentricMessages
from server.web.instrument_message import InstrumentMessages
from server.web.state_message import StateMessages


def messages_of(configuration: Configuration) -> StateMessages:
    """Makes the messages of the robot that ``configuration`` chooses."""
    if configuration.robot == "concentric":
        return ConcentricMessages(configuration)
    return InstrumentMessages(configuration)
