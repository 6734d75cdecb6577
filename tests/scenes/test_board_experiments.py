"""Paths of the experiments on boards and of the arc test: where they lead the tip, and when."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration
from robot.segment import tip_position, tip_rotation
from robot.start import start_bend, start_shaft_rotation, start_tip_rotation
from scenes.boards.board import board
from scenes.boards.place import place
from scenes.experiments import experiment
from scenes.experiments.bending import BENDING_S, sweep
from scenes.experiments.stylus_model import csv_text, recording
from scenes.experiments.timing import cruise, minimum_jerk
from server.configuration_file import load

RECORDING = FilePath(__file__).parents[2] / "scenes" / "experiments" / "arc_stylus.csv"


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return load()


def tip_poses(
    name: str, configuration: Configuration, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Desired tip (n, 3), base frame, m, and rotations (n, 3, 3)."""
    path, here = experiment(name, configuration).path, place(configuration)
    rows = np.empty((len(times), 7))
    for time_s, row in zip(times, rows, strict=True):
        path.at(time_s, row)
    turns = Rotation.from_quat(rows[:, [4, 5, 6, 3]]).as_matrix()
    return here.tip + rows[:, :3], turns @ here.tip_rotation


def test_shares_of_time_go_from_rest_to_rest() -> None:
    share = np.linspace(-0.2, 1.2, 1401)
    for done in (minimum_jerk(share), *(cruise(share, ramp) for ramp in (0.0, 0.05, 0.3, 0.5))):
        np.testing.assert_array_equal(done[share <= 0.0], 0.0)
        np.testing.assert_allclose(done[share >= 1.0], 1.0, atol=1e-12)
        assert (np.diff(done) >= -1e-12).all()
        np.testing.assert_allclose(done + done[::-1], 1.0, atol=1e-9)
    speed = np.diff(cruise(share, 0.1)) / 1e-3
    assert speed.max() == pytest.approx(1.0 / 0.9, rel=1e-6)
    assert np.abs(np.diff(speed)).max() / 1e-3 < 1.1 / 0.9 / 0.1 * 1.875


# The arc.


def test_the_arc_is_5_cm_long(configuration: Configuration) -> None:
    position, _ = tip_poses("arc", configuration, np.linspace(0.0, 12.0, 6001))
    assert np.linalg.norm(np.diff(position, axis=0), axis=1).sum() == pytest.approx(0.050, abs=2e-5)


@pytest.mark.parametrize("name", ["arc", "arc-stylus"])
def test_the_arc_is_what_the_segment_alone_can_do(name: str, configuration: Configuration) -> None:
    """With the shaft where it is at the start, some (u, v) inside the limit gives each pose."""
    position, rotation = tip_poses(name, configuration, np.linspace(0.0, 12.0, 200))
    shaft = start_shaft_rotation(configuration)
    length = configuration.instrument.segment_length_m
    start = np.empty(3)
    tip_position(*start_bend(configuration), length, start)
    base = place(configuration).tip - shaft @ start
    reached, turned = np.empty(3), np.empty((3, 3))
    for where, turn in zip(position, rotation, strict=True):
        v, u, twist = Rotation.from_matrix(shaft.T @ turn).as_rotvec()
        assert abs(twist) < 1e-4
        assert math.degrees(math.hypot(u, v)) < 63.0
        tip_position(u, v, length, reached)
        tip_rotation(u, v, turned)
        np.testing.assert_allclose(base + shaft @ reached, where, atol=2e-6)
        np.testing.assert_allclose(shaft @ turned, turn, atol=1e-4)


def test_the_arc_bends_first_and_turns_then(configuration: Configuration) -> None:
    times = np.linspace(0.0, 12.0, 1201)
    uv = np.degrees(sweep(configuration, times))
    bend, direction = np.hypot(*uv.T), np.degrees(np.arctan2(uv[:, 1], uv[:, 0]))
    first = times <= BENDING_S
    assert np.abs(uv[first, 1]).max() < 1e-9
    assert uv[first, 0].max() == pytest.approx(60.0)
    assert uv[first, 0].min() == pytest.approx(-60.0)
    np.testing.assert_allclose(bend[~first], 30.0)
    turning = np.unwrap(direction[~first], period=360.0)
    assert abs(turning[-1] - turning[0]) > 60.0
    assert experiment("arc", configuration).marks == (BENDING_S,)


def test_the_arm_stands_still_for_the_arc_alone(configuration: Configuration) -> None:
    for name in ("arc", "arc-stylus"):
        one = experiment(name, configuration)
        assert one.lock_arm
        assert one.needs_room
    assert not experiment("square", configuration).lock_arm


def test_the_recording_is_what_its_model_makes_and_says_so(configuration: Configuration) -> None:
    text = RECORDING.read_text(encoding="utf-8")
    assert "synthetic" in text.splitlines()[0]
    made = csv_text(recording(configuration))
    rows = [np.loadtxt(one.splitlines()[3:], delimiter=",") for one in (text, made)]
    np.testing.assert_allclose(rows[0], rows[1], atol=2e-3)


def test_the_stylus_follows_the_arc_as_a_hand_does(configuration: Configuration) -> None:
    times = np.linspace(0.0, 12.0, 1201)
    hand, _ = tip_poses("arc-stylus", configuration, times)
    computed, _ = tip_poses("arc", configuration, times)
    away = np.linalg.norm(hand - computed, axis=1)
    assert 2e-4 < away.max() < 6e-3


@pytest.mark.parametrize("bend", [0.0, 20.0, 75.0])
def test_the_arc_starts_wherever_the_robot_does(bend: float, configuration: Configuration) -> None:
    start = configuration.start.model_copy(update={"bend_deg": bend, "direction_deg": 30.0})
    there = configuration.model_copy(update={"start": start})
    for name in ("arc", "arc-stylus"):
        samples = experiment(name, there).path.samples
        np.testing.assert_allclose(samples[0, 1:4], 0.0, atol=1e-12)
        np.testing.assert_allclose(np.abs(samples[0, 4]), 1.0, atol=1e-12)
        assert np.linalg.norm(np.diff(samples[:, 1:4], axis=0), axis=1).max() < 1e-3


# Pegs, grooves, rings.


def test_the_square_stops_over_every_peg(configuration: Configuration) -> None:
    one = experiment("square", configuration)
    assert one.board == "pegboard"
    pegs = [peg for peg in board("pegboard", configuration).solids if peg.name.endswith("peg")]
    position, _ = tip_poses("square", configuration, np.array([0.0, *one.marks]))
    for tip, peg in zip(position, [*pegs, pegs[0]], strict=True):
        np.testing.assert_allclose(tip[:2], peg.position[:2], atol=1e-9)
        assert tip[2] > peg.position[2]


@pytest.mark.parametrize("name", ["silicon-sine", "silicon-arc"])
def test_the_tip_is_always_right_behind_the_ball(name: str, configuration: Configuration) -> None:
    """The rounded end touches a ball on the centre line, ahead along the groove."""
    assert experiment(name, configuration).board == name
    one, here = board(name, configuration), place(configuration)
    assert one.groove is not None
    assert one.ball is not None
    begin = 0.0 if name == "silicon-sine" else 4.0
    position, rotation = tip_poses(name, configuration, np.linspace(begin + 2.5, 18.0, 200))
    line = one.groove.centre_line
    headings = np.diff(line, axis=0)
    for tip, turn in zip(position, rotation, strict=True):
        rounded = tip - here.tip_radius * turn[:, 2]
        away = np.linalg.norm(line - rounded, axis=1) - one.ball.radius - here.tip_radius
        # The line crosses the touching distance once ahead of the tip.
        ahead = int(np.argmin(np.abs(away[np.argmin(away) :]))) + int(np.argmin(away))
        assert abs(away[ahead]) < 3e-4
        push = (line[ahead] - rounded)[:2]
        along = headings[min(ahead, len(headings) - 1), :2]
        cosine = push @ along / np.linalg.norm(push) / np.linalg.norm(along)
        assert cosine > math.cos(math.radians(2.0))


@pytest.mark.parametrize("name", ["silicon-sine", "silicon-arc"])
def test_the_ball_is_free_at_first_and_past_the_end_at_last(
    name: str, configuration: Configuration
) -> None:
    one, here = board(name, configuration), place(configuration)
    assert one.ball is not None
    assert one.groove is not None
    position, rotation = tip_poses(name, configuration, np.array([0.0, 20.0]))
    rounded = position - here.tip_radius * rotation[:, :, 2]
    touching = one.ball.radius + here.tip_radius
    assert np.linalg.norm(one.ball.position - rounded[0]) > touching + 0.001
    assert np.linalg.norm(one.groove.centre_line[-1] - rounded[1]) < touching


def test_the_tip_turns_with_the_arc_and_not_on_the_sine(configuration: Configuration) -> None:
    times = np.linspace(0.0, 20.0, 401)
    for name, largest in (("silicon-sine", 0.0), ("silicon-arc", 45.0)):
        _, rotation = tip_poses(name, configuration, times)
        start = start_tip_rotation(configuration)
        turn = Rotation.from_matrix(rotation @ start.T).as_rotvec(degrees=True)
        assert np.abs(turn[:, :2]).max() < 1e-6
        assert turn[:, 2].min() == pytest.approx(-largest, abs=1e-3)
        assert turn[:, 2].max() == pytest.approx(largest, abs=1e-3)


def test_the_tip_goes_half_way_through_each_ring_along_its_axis(
    configuration: Configuration,
) -> None:
    one = experiment("ring-board", configuration)
    rings = board(one.board, configuration).rings
    assert len(one.marks) == len(rings)
    assert one.duration_s == 12.0 * len(rings)
    for index, (ring, mark) in enumerate(zip(rings, one.marks, strict=True)):
        times = np.linspace(12.0 * index, 12.0 * (index + 1), 601)
        position, rotation = tip_poses("ring-board", configuration, times)
        depth = (position - ring.centre) @ ring.axis
        aside = np.linalg.norm(np.cross(position - ring.centre, ring.axis), axis=1)
        # Past the plane by more than the tip's rounded end, at the mark, and only there.
        assert depth.max() > place(configuration).tip_radius
        assert depth[np.argmin(np.abs(times - mark))] == pytest.approx(depth.max())
        near = (depth > -0.0099) & (times > mark - 3.5)
        assert aside[near].max() < 1e-6
        pointing = rotation[near][:, :, 2] @ ring.axis
        assert pointing.min() > math.cos(1e-4)
        # Out again before it goes on.
        assert depth[-1] == pytest.approx(-0.010, abs=1e-6)
