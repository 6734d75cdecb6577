"""What an xArm's controller means by its codes, and what to do about each: a table."""

from __future__ import annotations

from typing import NamedTuple


class Meaning(NamedTuple):
    """One code: what happened, and what a person does about it."""

    what: str
    remedy: str


_RECOVER = "then reboot the devices"
_POWER = "switch the controller off and on; if it stays, ask the maker"

_JOINTS = {
    10 + joint: Meaning(f"the servo of joint {joint} failed", f"free the arm, {_RECOVER}")
    for joint in range(1, 8)
}

ERRORS: dict[int, Meaning] = {
    1: Meaning("the controller's emergency stop is pressed", f"release it, {_RECOVER}"),
    2: Meaning("the emergency input of the controller is open", f"close it, {_RECOVER}"),
    3: Meaning("the enabling switch's emergency stop is pressed", f"release it, {_RECOVER}"),
    10: Meaning("a joint's servo failed", f"free the arm, {_RECOVER}"),
    **_JOINTS,
    18: Meaning("the force sensor does not answer", "check that it is mounted"),
    19: Meaning("the tool at the flange does not answer", "take it out of the arm's settings"),
    21: Meaning("the arm's kinematics failed", f"lead it to another posture, {_RECOVER}"),
    22: Meaning("the arm is about to touch itself", f"lead it apart by hand, {_RECOVER}"),
    23: Meaning("a joint is at its limit", f"lead it back by hand, {_RECOVER}"),
    24: Meaning("a joint was asked for too much speed", f"lower the speed limits, {_RECOVER}"),
    25: Meaning("the controller found no motion", f"lead it to another posture, {_RECOVER}"),
    26: Meaning("the controller's real time failed", _POWER),
    27: Meaning("the controller's answers failed inside", _POWER),
    28: Meaning("the flange's electronics do not answer", _POWER),
    30: Meaning("a joint turned faster than it may", "look what pushes the arm; ask the maker"),
    31: Meaning("a motor needs too much current: a collision?", f"free the arm, {_RECOVER}"),
    33: Meaning("the controller's inputs failed", "check their cables, power off and on"),
    35: Meaning("the arm is at its safety boundary", f"lead it inside by hand, {_RECOVER}"),
    37: Meaning("the arm moved oddly while led by hand", "check payload and mounting"),
    38: Meaning("a joint's angle cannot be", "press the emergency stop; ask the maker"),
    39: Meaning("the power board failed", "ask the maker"),
    40: Meaning("no joints reach the position", f"lead it to another posture, {_RECOVER}"),
    50: Meaning("the force sensor cannot be read", "check its cable"),
    53: Meaning("the force sensor is overloaded", f"free the arm, {_RECOVER}"),
    60: Meaning("the flange went too fast", f"lower the speed limits, {_RECOVER}"),
    110: Meaning("the arm's base does not answer", _POWER),
}
"""Errors: the arm has stopped, and follows nothing until they are gone."""

WARNINGS: dict[int, Meaning] = {
    11: Meaning(
        "the controller's list of commands is full", "another program sends as well: stop it"
    ),
    12: Meaning("the controller took a parameter for wrong", "tell what led to it"),
    13: Meaning("the controller does not know a command", "update its firmware"),
    14: Meaning("the controller finds no solution", "lead the arm to another posture"),
}
"""Warnings: the arm goes on."""


def error_message(code: int) -> str:
    """What error ``code`` means and what to do about it, in one line."""
    meaning = ERRORS.get(code, Meaning("the controller reports it", "look it up in its manual"))
    return f"error {code}: {meaning.what}; {meaning.remedy}"


def warning_message(code: int) -> str:
    """What warning ``code`` means and what to do about it, in one line."""
    meaning = WARNINGS.get(code, Meaning("the controller reports it", "look it up in its manual"))
    return f"warning {code}: {meaning.what}; {meaning.remedy}"
