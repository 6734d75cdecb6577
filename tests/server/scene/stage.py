"""What the tests of the scene share: a link without a control process, and ways to look."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import viser
import viser.transforms as tf
from numpy.typing import NDArray

from robot.concentric.kinematics import SOLVED
from robot.concentric.pair import ArmPair, PairKinematics, start_of
from robot.configuration import Configuration
from robot.forward import ForwardKinematics
from robot.instrument_robot import InstrumentRobot
from robot.record_types import record_types_of
from robot.records import RECORD, LeaderKind, Safety
from robot.rotations import matrix_from_quaternion, quaternion_from_matrix
from robot.urdf import urdf_text
from server.memory.mapped import MappedReadError
from server.scene.instrument_scene import InstrumentScene
from server.scene.view import SceneView


class Sample(NamedTuple):
    """A leader sample, and when it came (monotonic s)."""

    time: float
    sequence: int
    clutch: bool
    position: NDArray[np.float64]


class Link:
    """A link that hands out one record and keeps the samples."""

    def __init__(self, configuration: Configuration, record: NDArray[Any]) -> None:
        self.timeout = configuration.teleoperation.gizmo_timeout_ms * 1e-3
        self.directory = Path("a directory without paths")
        self.record = record
        self.record["header"]["tick"] = 1
        self.record["outcome"]["state"]["safety"] = Safety.ENABLED
        self.board: str = configuration.simulation.board
        self.samples: list[Sample] = []
        self.failures = 0
        self.reads = 0

    def snapshot(self) -> NDArray[Any]:
        self.reads += 1
        if self.failures:
            self.failures -= 1
            raise MappedReadError(Path("record"), "torn")
        return self.record

    def status(self) -> dict[str, Any]:
        return {"board": self.board}

    def leader(
        self,
        kind: LeaderKind,
        *,
        sequence: int,
        clutch: bool,
        position: NDArray[np.float64],
        wxyz: NDArray[np.float64],
        absolute: bool,
        smoothing_s: float,
        timeout_s: float,
    ) -> None:
        assert kind == LeaderKind.GIZMO
        assert not absolute
        assert smoothing_s == pytest.approx(0.05)
        assert timeout_s == pytest.approx(self.timeout)
        assert np.linalg.norm(wxyz) == pytest.approx(1.0)
        self.samples.append(Sample(time.monotonic(), sequence, clutch, position))


class Recorder(Link):
    """A link of the instrument."""

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration, np.zeros(1, RECORD))
        robot = InstrumentRobot(configuration)
        self.kinematics = ForwardKinematics(urdf_text(configuration), robot.parameters)
        self.start: NDArray[np.float64] = robot.initial_state()["x"][0].copy()
        self.record["input"]["trocar_position"] = configuration.trocar.position_m
        self.move(self.start)

    def move(self, x: NDArray[np.float64]) -> None:
        """Put robot, commanded and desired tip where the configuration ``x`` has them."""
        record = self.record.copy()
        truth, report = record["truth"], record["outcome"]["report"]
        self.kinematics.fill(truth, x[:7].copy(), float(x[7]), float(x[8]))
        for word in ("desired", "commanded"):
            report[f"{word}_position"] = truth["position"]
            report[f"{word}_wxyz"] = truth["wxyz"]
        state = record["outcome"]["state"][0]
        state["tip_position"] = truth["position"][0]
        matrix_from_quaternion(truth["wxyz"][0], state["tip_rotation"])
        self.record = record


class TubeRecorder(Link):
    """A link of the concentric-tube arms."""

    def __init__(self, configuration: Configuration) -> None:
        design = configuration.concentric
        super().__init__(configuration, np.zeros(1, record_types_of(configuration).record))
        self.pair = ArmPair(design)
        self.start = start_of(design.starts[design.start - 1])
        self.move(self.start)

    def move(self, q: NDArray[np.float64]) -> None:
        """Put true, commanded and desired arms where the configuration ``q`` has them."""
        found = PairKinematics(self.pair.count)
        found.q[:] = q
        assert self.pair.evaluate(found, np.zeros(2 * self.pair.count)) == SOLVED
        record = self.record.copy()
        truth, outcome = record["truth"][0], record["outcome"][0]
        report, state = outcome["report"], outcome["state"]
        for part in (truth, report, state):
            part["q"] = q
            part["position_b"] = found.position[1]
        for part in (truth, state):
            part["torsion"] = found.torsion
        truth["position"] = found.position[0]
        quaternion_from_matrix(found.rotation[0], truth["wxyz"])
        quaternion_from_matrix(found.rotation[1], truth["wxyz_b"])
        for word in ("desired", "commanded"):
            report[f"{word}_position"] = truth["position"]
            report[f"{word}_wxyz"] = truth["wxyz"]
        report["desired_b"], report["stability"] = found.position[1], found.stability
        self.record = record


def instrument_of(view: SceneView) -> InstrumentScene:
    """What is drawn of the instrument."""
    assert isinstance(view.robot, InstrumentScene)
    return view.robot


def until(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    """Wait for ``condition``."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)


def messages(server: viser.ViserServer) -> int:
    """Messages sent to all browsers since the start; viser counts them, but not in public."""
    return server._websock_server._broadcast_buffer.message_counter


def pose(server: viser.ViserServer, name: str) -> tf.SE3:
    """World pose of a scene node, through all its parents."""
    parts = name.strip("/").split("/")
    world = tf.SE3.identity()
    for count in range(1, len(parts) + 1):
        node = server.scene.get_handle_by_name("/" + "/".join(parts[:count]))
        assert node is not None, parts[:count]
        world = world @ tf.SE3.from_rotation_and_translation(tf.SO3(node.wxyz), node.position)
    return world


def handle(server: viser.ViserServer, name: str) -> Any:
    """The node of that name, which must exist."""
    node = server.scene.get_handle_by_name(name)
    assert node is not None, name
    return node


def somewhere(start: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A configuration near the start with any bend up to 1.5 rad."""
    x = start.copy()
    x[:7] += rng.uniform(-0.3, 0.3, 7)
    direction = rng.uniform(0.0, 2.0 * np.pi)
    x[7:9] = rng.uniform(0.0, 1.5) * np.array([np.cos(direction), np.sin(direction)])
    return x
