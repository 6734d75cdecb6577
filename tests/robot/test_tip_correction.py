"""The tracker as a slow correction: what is constant vanishes, and nothing jumps or shakes."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.instrument_robot import InstrumentRobot
from robot.records import Safety
from robot.sensing.tip_correction import OLDEST_S
from tests.robot.drive import DT, Drive, stood_still, wxyz

DELAY_S, PERIOD_TICKS = 0.02, 12
SHIFT = np.array([0.0012, -0.0007, 0.0009])
TURN = Rotation.from_rotvec([0.03, -0.02, 0.04])


class Offset:
    """A robot whose tip is not where it is commanded, and a late tracker that sees it."""

    def __init__(self, robot: InstrumentRobot) -> None:
        self.drive = Drive(robot)
        self.drive.input["settings"]["use_tracker"] = 1
        self.shift, self.turn = SHIFT, TURN
        self._seen: deque[tuple[np.ndarray, Rotation]] = deque()
        self._ticks = 0

    @property
    def true(self) -> tuple[np.ndarray, Rotation]:
        """Where the tip is."""
        state = self.drive.state[0]
        commanded = Rotation.from_matrix(state["tip_rotation"])
        return state["tip_position"] + self.shift, self.turn * commanded

    @property
    def correction(self) -> np.ndarray:
        """(6,) m and rad."""
        state = self.drive.state[0]
        parts = [state["correction_position"], state["correction_rotation"]]
        return np.concatenate(parts)

    def errors(self) -> tuple[float, float]:
        """Desired against true: m, rad."""
        position, rotation = self.drive.desired
        true, turned = self.true
        off = (Rotation.from_matrix(rotation).inv() * turned).magnitude()
        return float(np.linalg.norm(position - true)), float(off)

    def sample(self, position: np.ndarray, rotation: Rotation, age_s: float = DELAY_S) -> None:
        """A new sample for the next tick."""
        tracker = self.drive.input["tracker"]
        tracker["sequence"] += 1
        tracker["position"], tracker["wxyz"] = position, wxyz(rotation)
        tracker["age_s"] = age_s

    def tick(self) -> np.void:
        """One tick; now and then a sample of the tip as it was."""
        self._seen.append(self.true)
        if len(self._seen) > round(DELAY_S / DT):
            late = self._seen.popleft()
            if self._ticks % PERIOD_TICKS == 0:
                self.sample(*late)
        self._ticks += 1
        return self.drive.tick()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / DT)):
            self.tick()


@pytest.fixture
def offset(robot: InstrumentRobot) -> Offset:
    return Offset(robot)


def lead(drive: Drive, tick: int) -> None:
    angle = 2.0 * math.pi * tick * DT / 4.0
    drive.lead(0.006 * np.array([math.sin(angle), 1.0 - math.cos(angle), 0.5 * math.sin(angle)]))


def test_a_constant_offset_vanishes_while_driving(offset: Offset) -> None:
    drive = offset.drive
    drive.input["settings"]["case"] = 0
    drive.engage(np.zeros(3))
    assert offset.errors()[0] > 0.001
    errors = []
    for tick in range(3000):
        lead(drive, tick)
        offset.tick()
        errors.append(offset.errors())
    late = np.array(errors[2000:])
    assert late[:, 0].max() < 0.15e-3
    assert late[:, 1].max() < 0.004


def test_it_learns_how_far_off_the_tip_is(offset: Offset) -> None:
    offset.drive.engage(np.zeros(3))
    offset.run(3.0)
    found = offset.correction
    np.testing.assert_allclose(found[:3], SHIFT, rtol=0, atol=2e-5)
    np.testing.assert_allclose(found[3:], TURN.as_rotvec(), rtol=0, atol=1e-3)


def test_without_the_tracker_the_offset_stays(offset: Offset) -> None:
    offset.drive.input["settings"]["use_tracker"] = 0
    offset.drive.engage(np.zeros(3))
    for tick in range(500):
        lead(offset.drive, tick)
        offset.tick()
    np.testing.assert_array_equal(offset.correction, 0.0)
    assert offset.errors()[0] == pytest.approx(float(np.linalg.norm(SHIFT)), rel=0.05)


def test_no_sample_moves_the_correction_by_more_than_its_share(
    offset: Offset, rng: np.random.Generator
) -> None:
    """However noisy: a share of what a leader may jump; the tip is no faster than it may be.

    The leader's own speed, at most 12 mm/s here, comes on top of the correction's.
    """
    drive, p = offset.drive, offset.drive.robot.parameters[0]
    drive.engage(np.zeros(3))
    before, tip = offset.correction, drive.state[0]["tip_position"].copy()
    for tick in range(1000):
        lead(drive, tick)
        position, rotation = offset.true
        if tick % 5 == 0:
            noise = Rotation.from_rotvec(rng.normal(0.0, 0.1, 3))
            offset.sample(position + rng.normal(0.0, 0.004, 3), noise * rotation)
        drive.tick()
        now = offset.correction
        gain = p["correction_gain"]
        assert np.linalg.norm(now[:3] - before[:3]) <= 2.0 * gain * p["jump_position"]
        assert np.linalg.norm(now[3:] - before[3:]) <= 2.0 * gain * p["jump_angle"]
        assert np.linalg.norm(now[:3]) <= p["jump_position"]
        step = np.linalg.norm(drive.state[0]["tip_position"] - tip)
        assert step <= (p["speed_max"] + 0.012) * DT
        before, tip = now, drive.state[0]["tip_position"].copy()
        assert drive.safety == Safety.ENABLED


Sample = Callable[[Offset, np.ndarray, Rotation], None]


def _far(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.sample(position + np.array([0.016, 0.0, 0.0]), rotation)


def _turned_far(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.sample(position, Rotation.from_rotvec([0.0, math.radians(25.0), 0.0]) * rotation)


def _old(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.sample(position, rotation, OLDEST_S + 0.01)


def _no_number(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.sample(position * [1.0, math.nan, 1.0], rotation)


def _infinite(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.sample(position + np.array([math.inf, 0.0, 0.0]), rotation)


def _no_rotation(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.sample(position, rotation)
    offset.drive.input["tracker"]["wxyz"] = 0.0


def _rotation_without_numbers(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.sample(position, rotation)
    offset.drive.input["tracker"]["wxyz"] = math.nan


def _age_is_no_number(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.sample(position, rotation, math.nan)


def _nothing_new(offset: Offset, position: np.ndarray, rotation: Rotation) -> None:
    offset.drive.input["tracker"]["position"] = position
    offset.drive.input["tracker"]["wxyz"] = wxyz(rotation)


def unmoved(offset: Offset, spoil: Sample) -> None:
    """A robot that rests corrected, then is told such samples."""
    offset.drive.engage(np.zeros(3))
    offset.run(2.0)
    learnt = offset.correction
    assert np.linalg.norm(learnt) > 0.01
    for _ in range(100):
        spoil(offset, *offset.true)
        offset.drive.tick()
        assert offset.drive.safety == Safety.ENABLED
        np.testing.assert_array_equal(offset.correction, learnt)


@pytest.mark.parametrize("spoil", [_far, _turned_far])
def test_a_sample_that_is_far_off_is_not_believed(offset: Offset, spoil: Sample) -> None:
    unmoved(offset, spoil)


@pytest.mark.parametrize(
    "spoil",
    [
        _old,
        _no_number,
        _infinite,
        _no_rotation,
        _rotation_without_numbers,
        _age_is_no_number,
        _nothing_new,
    ],
)
def test_a_sample_that_is_old_or_no_pose_is_not_taken(offset: Offset, spoil: Sample) -> None:
    unmoved(offset, spoil)


def test_switching_the_tracker_off_lets_the_correction_fade(offset: Offset) -> None:
    drive = offset.drive
    drive.engage(np.zeros(3))
    offset.run(2.0)
    learnt = np.linalg.norm(offset.correction)
    drive.input["settings"]["use_tracker"] = 0
    last, tip = offset.correction, drive.state[0]["tip_position"].copy()
    for _ in range(round(2.0 / DT)):
        offset.tick()
        now = offset.correction
        assert np.linalg.norm(now) < np.linalg.norm(last)
        assert np.linalg.norm(now - last) < 0.01 * learnt
        moved = np.linalg.norm(drive.state[0]["tip_position"] - tip)
        assert moved < 0.02 * np.linalg.norm(SHIFT) + 1e-6
        last, tip = now, drive.state[0]["tip_position"].copy()
    assert np.linalg.norm(last) < 0.001 * learnt


@pytest.mark.parametrize("enabled", [False, True])
def test_nothing_moves_at_rest_however_the_correction_changes(
    offset: Offset, enabled: bool
) -> None:
    drive = offset.drive
    if enabled:
        drive.enable()
    still = drive.x
    for index in range(400):
        offset.shift = SHIFT * math.cos(0.01 * index)
        assert stood_still(offset.tick(), still)
    assert np.linalg.norm(offset.correction) > 1e-4


def test_closing_the_clutch_of_a_corrected_robot_moves_nothing(offset: Offset) -> None:
    """What is desired at rest is where the tip is, so nothing is off when the clutch closes."""
    drive = offset.drive
    drive.enable()
    offset.run(3.0)
    still, errors = drive.x, offset.errors()
    assert errors[0] < 0.05e-3
    assert errors[1] < 0.002
    drive.lead(np.array([0.3, 0.1, -0.2]))
    outcome = drive.tick()
    assert drive.state["engaged"][0] == 1
    np.testing.assert_allclose(drive.x[:9], still[:9], rtol=0, atol=1e-7)
    for _ in range(20):
        drive.lead(np.array([0.3, 0.1, -0.2]))
        outcome = drive.tick()
        np.testing.assert_allclose(drive.x[:9], still[:9], rtol=0, atol=2e-5)
    assert np.abs(outcome["report"]["twist"]).max() < 1e-4


def test_opening_the_clutch_stops_a_corrected_robot(offset: Offset) -> None:
    drive = offset.drive
    drive.engage(np.zeros(3))
    for tick in range(500):
        lead(drive, tick)
        offset.tick()
    drive.let_go()
    drive.tick()
    still = drive.x
    for _ in range(50):
        assert stood_still(offset.tick(), still)


def test_the_same_samples_give_the_same_motion(robot: InstrumentRobot) -> None:
    ends = []
    for _ in range(2):
        offset = Offset(robot)
        offset.drive.engage(np.zeros(3))
        for tick in range(200):
            lead(offset.drive, tick)
            offset.tick()
        ends.append(offset.drive.state.tobytes())
    assert ends[0] == ends[1]
