"""The experiments are what their titles say."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.priority.levels import CASE_NAMES
from robot.start import start_tip_rotation
from scenes.boards.board import board
from scenes.experiments import experiment, names
from server.configuration_file import load

STEPS = 2000


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return load()


def played(name: str, configuration: Configuration) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and rows (n, 7) of translation and quaternion."""
    path = experiment(name, configuration).path
    times = np.linspace(0.0, path.duration_s, STEPS + 1)
    rows = np.empty((len(times), 7))
    for time_s, row in zip(times, rows, strict=True):
        path.at(time_s, row)
    return times, rows


def turns(rows: np.ndarray) -> Rotation:
    return Rotation.from_quat(rows[:, [4, 5, 6, 3]])


def test_they_have_the_names_and_durations_of_the_command_line(
    configuration: Configuration,
) -> None:
    found = {name: experiment(name, configuration).duration_s for name in names()}
    assert found == {
        "arc": 12.0,
        "arc-stylus": 12.0,
        "circle": 20.0,
        "circle-yz": 20.0,
        "square": 40.0,
        "circle-infeasible": 8.0,
        "silicon-sine": 20.0,
        "silicon-arc": 20.0,
        "ring-board": 72.0,
        "ring-press": 32.5,
    }


def test_an_unknown_one_is_refused_with_the_known_ones(configuration: Configuration) -> None:
    with pytest.raises(UnknownName) as caught:
        experiment("spiral", configuration)
    assert caught.value.known == names()


@pytest.mark.parametrize("name", names())
def test_each_starts_at_the_start_and_from_rest(name: str, configuration: Configuration) -> None:
    path = experiment(name, configuration).path
    rows = np.empty((2, 7))
    for time_s, row in zip((0.0, 0.01), rows, strict=True):
        path.at(time_s, row)
    np.testing.assert_allclose(rows[0, :3], 0.0, rtol=0, atol=1e-12)
    assert turns(rows[:1]).magnitude()[0] < 1e-9
    if name != "circle-infeasible":
        assert np.linalg.norm(rows[1, :3]) / 0.01 < 2e-4
        assert turns(rows).magnitude()[1] / 0.01 < 0.02


@pytest.mark.parametrize("name", names())
def test_each_moves_without_jumps_and_slower_than_the_commands_allow(
    name: str, configuration: Configuration
) -> None:
    times, rows = played(name, configuration)
    speed = np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1) / np.diff(times)
    assert speed.max() * 1e3 < 0.5 * configuration.commands.speed_max_mm_s
    turning = turns(rows)
    rate = (turning[1:] * turning[:-1].inv()).magnitude() / np.diff(times)
    assert math.degrees(rate.max()) < configuration.commands.angular_speed_max_deg_s


@pytest.mark.parametrize("name", names())
def test_boards_cases_and_marks_are_real_ones(name: str, configuration: Configuration) -> None:
    one = experiment(name, configuration)
    assert board(one.board, configuration).name == one.board
    assert one.cases
    assert set(one.cases) <= set(CASE_NAMES)
    assert all(0.0 < mark <= one.duration_s for mark in one.marks)
    assert list(one.marks) == sorted(one.marks)


@pytest.mark.parametrize("name", ["circle", "circle-yz", "square", "circle-infeasible"])
def test_closed_ones_end_at_the_start(name: str, configuration: Configuration) -> None:
    _, rows = played(name, configuration)
    np.testing.assert_allclose(rows[[0, -1], :3], 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(turns(rows[[0, -1]]).magnitude(), 0.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["circle", "circle-yz", "square"])
def test_the_reachable_ones_keep_the_orientation(name: str, configuration: Configuration) -> None:
    assert turns(played(name, configuration)[1]).magnitude().max() < 1e-12


@pytest.mark.parametrize(
    ("name", "normal"), [("circle", 2), ("circle-yz", 0), ("circle-infeasible", 2)]
)
def test_circles_are_3_cm_across_in_their_plane(
    name: str, normal: int, configuration: Configuration
) -> None:
    times, rows = played(name, configuration)
    position = rows[:, :3]
    assert np.abs(position[:, normal]).max() < 1e-15
    centre = 0.5 * (position.max(axis=0) + position.min(axis=0))
    radius = np.linalg.norm(position - centre, axis=1)
    np.testing.assert_allclose(radius, 0.015, rtol=0, atol=1e-6)
    # Once around, at an even speed apart from the first and the last second.
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / np.diff(times)
    even = 0.0 if name == "circle-infeasible" else 1.0
    expected = 2.0 * math.pi * 0.015 / (times[-1] - even)
    inner = (times[1:] > even + 0.05) & (times[:-1] < times[-1] - even - 0.05)
    np.testing.assert_allclose(speed[inner], expected, rtol=1e-3)


def test_the_square_has_sides_of_23_mm_and_rests_at_its_corners(
    configuration: Configuration,
) -> None:
    times, rows = played("square", configuration)
    position = rows[:, :3]
    assert np.abs(position[:, 2]).max() == 0.0
    corners = position[[int(STEPS * share) for share in (0.0, 0.25, 0.5, 0.75, 1.0)]]
    sides = np.diff(corners, axis=0)
    np.testing.assert_allclose(np.linalg.norm(sides, axis=1), 0.023, rtol=0, atol=1e-12)
    for one, following in itertools.pairwise(sides):
        assert one @ following == pytest.approx(0.0, abs=1e-15)
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / np.diff(times)
    for share in (0.0, 0.25, 0.5, 0.75):
        assert speed[int(STEPS * share)] < 1e-5
    # Each side is a straight line.
    for index in range(4):
        part = position[index * STEPS // 4 : (index + 1) * STEPS // 4 + 1] - corners[index]
        assert np.abs(np.cross(part, sides[index])).max() < 1e-12


def test_the_infeasible_one_sweeps_40_degrees_about_the_tip_s_own_y_axis(
    configuration: Configuration,
) -> None:
    times, rows = played("circle-infeasible", configuration)
    start = start_tip_rotation(configuration)
    own = [start.T @ turn @ start for turn in turns(rows).as_matrix()]
    vectors = Rotation.from_matrix(np.array(own)).as_rotvec()
    assert np.abs(vectors[:, [0, 2]]).max() < 1e-7
    expected = math.radians(20.0) * (1.0 - np.cos(2.0 * math.pi * times / 8.0))
    np.testing.assert_allclose(vectors[:, 1], expected, rtol=0, atol=1e-5)
    assert math.degrees(vectors[:, 1].max()) == pytest.approx(40.0, abs=1e-3)
    # Toward more bend: 60 degrees at the start, so 40 more are beyond the limit of 90.
    bent_further = start @ Rotation.from_rotvec([0.0, 0.1, 0.0]).as_matrix()
    shaft = np.array(configuration.start.shaft_direction)
    assert shaft @ bent_further[:, 2] < shaft @ start[:, 2]
