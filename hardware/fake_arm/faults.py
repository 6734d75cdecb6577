"""What can go wrong with an arm, by name, for tests and demonstrations."""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """One fault.

    Attributes:
        meaning: what happens.
        error: the controller's error code that it raises; 0 for none.
        lasts: whether it lasts until it is cleared.
    """

    meaning: str
    error: int
    lasts: bool


FAULTS: dict[str, Fault] = {
    "emergency-stop": Fault("the controller's emergency stop is pressed", 1, True),
    "joint-error": Fault("the servo of joint 3 fails", 13, False),
    "collision": Fault("a motor's current tells of a collision", 31, False),
    "self-collision": Fault("the arm is about to touch itself", 22, False),
    "stopped": Fault("somebody else stops the arm", 0, False),
    "drop": Fault("all connections are closed; new ones are taken", 0, False),
    "unplugged": Fault("all connections are closed; new ones are refused", 0, True),
    "silent": Fault("neither answers nor reports come; the connections stay", 0, True),
    "no-reports": Fault("reports stop, answers come", 0, True),
    "slow": Fault("every answer comes 0.2 s late", 0, True),
    "wrong-report": Fault("reports come with a length that cannot be", 0, True),
    "not-a-number": Fault("reports say that joint 2 stands at no number", 0, True),
}
"""Every fault there is."""
