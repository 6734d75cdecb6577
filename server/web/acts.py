"""What a request asks for, in words for people."""

from __future__ import annotations

ROBOTS = "/api/v1/robots/"
DRAG = "/viser"
"""Path under which the scene's messages come."""

_ACTS = {
    ("POST", "lease"): "take control",
    ("POST", "lease/renew"): "go on driving",
    ("POST", "lease/hand-over"): "offer control to somebody",
    ("DELETE", "lease/hand-over"): "withdraw the offer of control",
    ("POST", "lease/request"): "ask for control",
    ("DELETE", "lease/request"): "decline a request for control",
    ("DELETE", "lease"): "release control",
    ("POST", "emergency-stop"): "press the emergency stop",
    ("POST", "enable"): "enable the robot",
    ("POST", "disable"): "disable the robot",
    ("POST", "pause"): "pause the robot",
    ("POST", "reset"): "reset a fault",
    ("POST", "target"): "set a target",
    ("DELETE", "target"): "clear the target",
    ("POST", "leader"): "lead the tip",
    ("POST", "path"): "play a path",
    ("DELETE", "path"): "stop the path",
    ("POST", "withdraw"): "withdraw the shaft",
    ("PUT", "priority"): "change the priority",
    ("PUT", "teleoperation"): "change the settings of the leader",
    ("PUT", "compensation"): "change the compensation",
    ("PUT", "tendons"): "change what the tendons hold",
    ("PUT", "sensing"): "switch sensing on or off",
    ("PUT", "board"): "change the board",
    ("POST", "trocar"): "register the trocar",
    ("PUT", "trocar/breathing"): "change the breathing",
    ("POST", "recording"): "start a recording",
    ("DELETE", "recording"): "stop the recording",
    ("PUT", "method"): "change the method",
    ("POST", "select"): "drive another robot",
    ("POST", "home"): "home the instrument",
    ("POST", "torque/release"): "release the torque",
    ("POST", "torque/hold"): "put torque on",
    ("POST", "devices/reboot"): "reboot the servos",
    ("POST", "faults"): "inject a fault",
    ("DELETE", "faults"): "clear the injected faults",
    ("POST", DRAG): "drag the gizmo",
    ("GET", DRAG): "open the scene",
    ("GET", "stream"): "open the stream",
    ("GET", "state"): "read the state",
}

OFTEN = ("leader", "target", "lease/renew", "gamepad")
"""Asked for many times a second: logged once in a while, with how often."""


def route_of(path: str) -> str:
    """What follows the robot's name in a path of the API, else the whole path."""
    if path.startswith(ROBOTS):
        return path[len(ROBOTS) :].partition("/")[2] or path
    return path


def act_of(method: str, path: str) -> str:
    """As in "tried to …"; a request that has no words is named as it stands."""
    known = _ACTS.get((method, route_of(path)))
    if known is not None:
        return known
    if method == "GET" and not path.startswith("/api/"):
        return "open the page"
    return f"{method} {path[:120]}"
