"""The experiments are what their titles say."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.start import start_tip_rotation
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
    assert found == {"circle": 20.0, "circle-yz": 20.0, "square": 40.0, "circle-infeasible": 8.0}


def test_an_unknown_one_is_refused_with_the_known_ones(configuration: Configuration) -> None:
    with pytest.raises(UnknownName) as caught:
        experiment("spiral", configuration)
    assert caught.value.known == names()


@pytest.mark.parametrize("name", names())
def test_each_starts_and_ends_at_the_start(name: str, configuration: Configuration) -> None:
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
    # Once around, at an even speed.
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / np.diff(times)
    expected = 2.0 * math.pi * 0.015 / times[-1]
    np.testing.assert_allclose(speed[5:-5], expected, rtol=1e-3)


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
