"""A robot at the end of a test's strings: one input a tick, and a plant that obeys exactly."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import INPUT, OUTCOME, LeaderKind, Request, Safety
from robot.tendons import servo_angles
from server.control.instrument_loop import default_settings

DT = 0.002


def wxyz(rotation: Rotation) -> np.ndarray:
    """Quaternion (4,) in the order of the records."""
    return np.asarray(rotation.as_quat()[[3, 0, 1, 2]])


def random_rotation(rng: np.random.Generator) -> Rotation:
    """Uniformly distributed."""
    return Rotation.from_quat(rng.normal(size=4))


def with_steady_cells(configuration: Configuration) -> Configuration:
    """For torque cells without noise, whose readings may stay as they are."""
    unit = configuration.tension_unit.model_copy(update={"cell_flat_ms": 0.0})
    return configuration.model_copy(update={"tension_unit": unit})


class Drive:
    """State, input and outcome of one robot.

    Attributes:
        state: (1,) ``STATE`` that the next tick starts from.
        input: (1,) ``INPUT`` that it will take; the request is consumed.
        outcome: (1,) ``OUTCOME`` of the last tick.
        obedient: whether the measured joints are the commanded ones.
    """

    def __init__(self, robot: InstrumentRobot, x: np.ndarray | None = None) -> None:
        """Stand at the start, or at ``x`` (10,)."""
        self.robot = robot
        self.state = robot.initial_state(x)
        self.outcome = np.zeros(1, OUTCOME)
        self.input = np.zeros(1, INPUT)
        self.input["dt_s"] = DT
        self.input["measured_valid"] = 1
        self.input["trocar_position"] = robot.configuration.trocar.position_m
        self.input["settings"] = default_settings(robot.configuration)
        self.input["leader"]["timeout_s"] = 0.1
        self.input["leader"]["wxyz"] = [1.0, 0.0, 0.0, 0.0]
        self.obedient = True

    def tick(self, request: Request = Request.NONE) -> np.void:
        """One tick; its outcome."""
        if self.obedient:
            self.measure(self.state["x"][0])
        self.input["request"] = request
        self.robot.tick(self.state, self.input, self.outcome)
        self.state = self.outcome["state"].copy()
        outcome: np.void = self.outcome[0]
        return outcome

    def measure(self, x: np.ndarray) -> None:
        """Let the sensors say that the robot stands at ``x`` (10,)."""
        p = self.robot.parameters[0]
        servo = np.empty(4)
        servo_angles(x[7], x[8], p["pitch_radius"], p["pulley_radius"], servo)
        self.input["measured_q"] = x[:7]
        self.input["measured_servo"] = servo

    def lead(
        self,
        position: np.ndarray,
        rotation: Rotation | None = None,
        *,
        kind: LeaderKind = LeaderKind.API_POSE,
        absolute: bool = False,
    ) -> None:
        """Give the next ticks a new sample of a leader with its clutch closed."""
        leader = self.input["leader"]
        leader["kind"], leader["clutch"], leader["absolute"] = kind, 1, absolute
        leader["sequence"] += 1
        leader["position"] = position
        leader["wxyz"] = wxyz(Rotation.identity() if rotation is None else rotation)

    def let_go(self) -> None:
        """Open the clutch."""
        self.input["leader"]["clutch"] = 0

    def enable(self) -> None:
        """Enable; fails if the robot does not."""
        self.tick(Request.ENABLE)
        assert self.safety == Safety.ENABLED

    def engage(self, position: np.ndarray, rotation: Rotation | None = None) -> None:
        """Enable and close the clutch of a relative leader; fails if it does not engage."""
        self.enable()
        self.lead(position, rotation)
        self.tick()
        assert self.state["engaged"][0] == 1

    @property
    def safety(self) -> Safety:
        """The safety state after the last tick."""
        return Safety(int(self.state["safety"][0]))

    @property
    def x(self) -> np.ndarray:
        """(10,) commanded configuration after the last tick."""
        return np.asarray(self.state["x"][0]).copy()

    @property
    def desired(self) -> tuple[np.ndarray, np.ndarray]:
        """Desired tip position (3,) and rotation (3, 3) after the last tick."""
        state = self.state[0]
        return state["desired_position"].copy(), state["desired_rotation"].copy()


def stood_still(outcome: np.void, x: np.ndarray) -> bool:
    """Whether the command is zero motion, bit for bit, at the configuration ``x`` (10,)."""
    command, report = outcome["command"], outcome["report"]
    return bool(
        command["moving"] == 0
        and np.array_equal(command["q"], x[:7])
        and np.array_equal(report["x"][:9], x[:9])
        and not report["x_dot"].any()
    )


def random_x(
    robot: InstrumentRobot, rng: np.random.Generator, bend_share: float = 1.0
) -> np.ndarray:
    """(10,) anywhere inside the limits; the bend up to ``bend_share`` of its limit."""
    p = robot.parameters[0]
    q = rng.uniform(p["joint_lower"], p["joint_upper"])
    phi = p["bend_max"] * bend_share * np.sqrt(rng.uniform())
    delta = rng.uniform(-np.pi, np.pi)
    along = rng.uniform(p["lambda_min"], p["lambda_max"])
    return np.array([*q, phi * np.cos(delta), phi * np.sin(delta), along])
