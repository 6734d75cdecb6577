"""The real arm: whether its library is there and its controller answers. Nothing is sent to it."""

from __future__ import annotations

import importlib.util
import socket

from hardware.arm.address import InvalidArmAddress, arm_address
from robot.configuration import Hardware
from server.doctor.finding import Finding, failure, fine

_PATIENCE_S = 2.0
_AREA = "arm"


def examine(settings: Hardware) -> list[Finding]:
    """What stands between us and the arm; nothing where it is not a real one."""
    if settings.arm != "xarm":
        return [fine(_AREA, f"{settings.arm}: needs no device")]
    findings = []
    if importlib.util.find_spec("xarm") is None:
        findings.append(
            failure(
                _AREA,
                "the package xarm-python-sdk is not installed",
                "the arm cannot be driven",
                ".venv/bin/pip install -c constraints.txt xarm-python-sdk",
            )
        )
    try:
        address = arm_address(settings.arm_address)
        with socket.create_connection((address.host, address.control), _PATIENCE_S):
            findings.append(fine(_AREA, f"the controller at {address} listens"))
    except InvalidArmAddress as error:
        findings.append(failure(_AREA, str(error), "the arm cannot be reached", "correct it"))
    except OSError as error:
        findings.append(
            failure(
                _AREA,
                f"no controller at {settings.arm_address}: {error}",
                "the arm cannot be reached",
                "switch the controller on, and give this machine an address in its network",
            )
        )
    return findings
