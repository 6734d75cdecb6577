"""The mapped files of a console, and the control process as a leader sees it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.configuration import Configuration, Stylus
from robot.records import RECORD, LeaderKind, Safety
from server.configuration_file import load
from server.leaders.stylus_input import StylusInput
from server.memory.leader_slot import LeaderSlot
from server.memory.link_records import (
    LEADER_SLOT,
    RECORD_SLOT_FILE,
    create_mapped_files,
    leader_file,
)
from server.memory.mapped import MappedSlot
from tests.server.fake_stylus.conftest import RunningStylus


class ControlSide:
    """What control publishes, and what it would read of a leader.

    Args:
        directory: with the mapped files.
        kind: of the leader.
    """

    def __init__(self, directory: Path, kind: LeaderKind = LeaderKind.STYLUS) -> None:
        self.directory = directory
        self.record = np.zeros(1, RECORD)
        self.record["outcome"]["state"]["anchor_rotation_base_leader"] = np.eye(3)
        self.record["outcome"]["state"]["anchor_scale"] = 1.0
        self._slot = MappedSlot(directory / RECORD_SLOT_FILE, RECORD, writable=True)
        self._leader = MappedSlot(directory / leader_file(kind), LEADER_SLOT)

    def say(self, safety: Safety, *, engaged: bool = False, age_s: float = 0.0) -> None:
        """Publish a record that is ``age_s`` old."""
        state = self.record["outcome"]["state"]
        state["safety"], state["engaged"] = int(safety), int(engaged)
        state["leader_kind"] = int(LeaderKind.STYLUS)
        self.record["header"]["stamp_ns"] = time.monotonic_ns() - round(age_s * 1e9)
        self._slot.write(self.record)

    @property
    def published(self) -> int:
        """How many samples the leader has published."""
        return self._leader.sequence

    def sample(self) -> np.void:
        """The leader's newest sample."""
        found: np.void = self._leader.read()[0]["leader"]
        return found

    def stamp_ns(self) -> int:
        """When it was measured."""
        return int(self._leader.read()[0]["stamp_ns"])

    def position(self) -> NDArray[np.float64]:
        """(3,) of the leader's newest sample, m."""
        return np.array(self.sample()["position"])


@pytest.fixture(scope="session")
def configuration() -> Configuration:
    return load()


@pytest.fixture
def stylus_configuration(configuration: Configuration) -> Stylus:
    return configuration.stylus


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    create_mapped_files(tmp_path, 500.0, 1.0)
    return tmp_path


@pytest.fixture
def control(directory: Path) -> ControlSide:
    return ControlSide(directory)


@pytest.fixture
def stylus(directory: Path, stylus_configuration: Stylus) -> Iterator[StylusInput]:
    """The input of a stylus that has been connected for two seconds."""
    slot = LeaderSlot(directory, LeaderKind.STYLUS)
    given = StylusInput(slot, stylus_configuration)
    given.connected(time.monotonic_ns() - 2_000_000_000)
    yield given
    slot.close()


@pytest.fixture
def fake(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStylus]:
    running = RunningStylus(tmp_path_factory.mktemp("stylus"))
    yield running
    running.end()
