"""A fake controller on ports that are free, at the configured start."""

from __future__ import annotations

import functools
import os
import sys

import numpy as np

from hardware.arm.address import ArmAddress
from hardware.fake_arm.controller import Controller
from hardware.fake_arm.program import FakeArm
from robot.configuration import Configuration
from server.configuration_file import load

START = np.array([0.1, 0.4, -0.2, 1.2, 0.1, 1.5, -0.3])


@functools.cache
def configuration() -> Configuration:
    """The one that comes along."""
    return load()


def limits() -> tuple[np.ndarray, np.ndarray]:
    """(7,) lower and upper joint limits, rad."""
    joints = configuration().arm.joints
    lower = np.array([joint.lower_rad for joint in joints])
    return lower, np.array([joint.upper_rad for joint in joints])


def controller(q: np.ndarray = START) -> Controller:
    """A controller that has just been switched on."""
    return Controller(q, *limits())


@functools.cache
def address() -> ArmAddress:
    """On loopback, where the system has more of it an address of our own, for other tests that run
    at the same time have arms too; the command port needs no rights.
    """
    if sys.platform != "linux":
        return ArmAddress("127.0.0.1", 5020)
    number = os.getpid()
    return ArmAddress(f"127.77.{number >> 8 & 255}.{number % 254 + 1}", 5020)


def fake_arm(q: np.ndarray = START) -> FakeArm:
    """A fake arm, not yet started."""
    return FakeArm(controller(q), address())
