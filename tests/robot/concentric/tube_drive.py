"""Concentric-tube arms at the end of a test's strings, with a plant that obeys exactly."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.concentric.concentric_robot import ConcentricRobot
from robot.concentric.design import METHODS
from robot.configuration import Configuration
from robot.records import LeaderKind, Request, Safety
from server.configuration_file import load


def concentric(limits: dict[str, Any] | None = None, **changes: Any) -> Configuration:
    """The usual configuration with the concentric-tube arms chosen, and changes to their table."""
    configuration = load()
    design = configuration.concentric
    if limits:
        changes["limits"] = design.limits.model_copy(update=limits)
    design = design.model_copy(update=changes)
    return configuration.model_copy(update={"robot": "concentric", "concentric": design})


class TubeDrive:
    """State, input and outcome of one pair of arms.

    Attributes:
        state: (1,) that the next tick starts from.
        input: (1,) that it will take; the request is consumed.
        outcome: (1,) of the last tick.
        obedient: whether the measured tubes are the commanded ones.
    """

    def __init__(self, robot: ConcentricRobot, method: str = "hqp") -> None:
        self.robot = robot
        self.state = robot.initial_state()
        self.outcome = np.zeros(1, robot.types.outcome)
        self.input = np.zeros(1, robot.types.record["input"])
        self.input["dt_s"] = 1.0 / robot.configuration.concentric.rate_hz
        self.input["measured_valid"] = 1
        settings = self.input["settings"]
        settings["motion_scale"], settings["lock_rotation"] = 1.0, 1
        settings["rotation_base_leader"] = np.eye(3)
        settings["method"] = METHODS.index(method)
        self.input["leader"]["timeout_s"] = 0.1
        self.input["leader"]["wxyz"] = [1.0, 0.0, 0.0, 0.0]
        self.obedient = True

    def tick(self, request: Request = Request.NONE) -> np.void:
        """One tick; its outcome."""
        if self.obedient:
            self.input["measured_q"] = self.state["q"]
        self.input["request"] = request
        self.robot.tick(self.state, self.input, self.outcome)
        self.state = self.outcome["state"].copy()
        outcome: np.void = self.outcome[0]
        return outcome

    def enable(self) -> None:
        """Enable; fails if the robot does not."""
        self.tick(Request.ENABLE)
        assert self.safety == Safety.ENABLED

    def lead_to(self, position: np.ndarray, kind: LeaderKind = LeaderKind.API_TARGET) -> None:
        """Give the next ticks a target (3,), base frame, m."""
        leader = self.input["leader"]
        leader["kind"], leader["clutch"], leader["absolute"] = kind, 1, 1
        leader["sequence"] += 1
        leader["position"] = position

    @property
    def safety(self) -> Safety:
        """The safety state after the last tick."""
        return Safety(int(self.state["safety"][0]))

    @property
    def tip(self) -> np.ndarray:
        """(3,) A's commanded tip after the last tick, m."""
        return np.asarray(self.state["tip_position"][0]).copy()

    @property
    def q(self) -> np.ndarray:
        """(4n,) commanded tubes after the last tick."""
        return np.asarray(self.state["q"][0]).copy()
