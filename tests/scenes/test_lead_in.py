"""The way in to where a path shall start: it ends there, from rest to rest, and over obstacles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.configuration import Configuration
from scenes.boards.board import board
from scenes.boards.clearance import distances
from scenes.boards.place import place
from scenes.experiments import experiment
from scenes.lead_in import NEAR_M, SPEED_M_S, TURN_RAD_S, anchored
from scenes.path import Path
from server.configuration_file import load


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return load()


def at(path: Path, times: np.ndarray) -> tuple[np.ndarray, Rotation]:
    rows = np.empty((len(times), 7))
    for time_s, row in zip(times, rows, strict=True):
        path.at(time_s, row)
    return rows[:, :3], Rotation.from_quat(rows[:, [4, 5, 6, 3]])


@pytest.mark.parametrize("distance", [0.0, 0.003, 0.05])
def test_the_path_is_played_where_it_was_made_for(
    distance: float, configuration: Configuration, rng: np.random.Generator
) -> None:
    here = place(configuration)
    aside = rng.normal(size=3)
    tip = here.tip + distance * aside / np.linalg.norm(aside)
    turned = Rotation.from_rotvec(0.3 * rng.normal(size=3)) * Rotation.from_matrix(
        here.tip_rotation
    )
    path = experiment("ring-board", configuration).path
    whole, way_s = anchored(path, here.tip, here.tip_rotation, tip, turned.as_matrix())
    assert whole.duration_s == pytest.approx(way_s + path.duration_s)
    times = np.linspace(0.0, path.duration_s, 400)
    wanted, turns = at(path, times)
    found, found_turns = at(whole, times + way_s)
    np.testing.assert_allclose(tip + found, here.tip + wanted, atol=1e-9)
    start = Rotation.from_matrix(here.tip_rotation)
    assert ((found_turns * turned) * (turns * start).inv()).magnitude().max() < 1e-6


@pytest.mark.parametrize("distance", [0.0, 0.003, 0.05])
def test_the_way_is_slow_and_without_jumps(distance: float, configuration: Configuration) -> None:
    here = place(configuration)
    tip = here.tip + np.array([distance, 0.0, 0.0])
    turned = Rotation.from_rotvec([0.0, 0.5, 0.0]).as_matrix() @ here.tip_rotation
    path = Path(np.array([[0, 0, 0, 0, 1, 0, 0, 0], [5, 0, 0, 0, 1, 0, 0, 0.0]]), "stay")
    whole, way_s = anchored(path, here.tip, here.tip_rotation, tip, turned)
    times = np.arange(0.0, way_s + 1.0, 0.01)
    position, turns = at(whole, times)
    np.testing.assert_allclose(position[0], 0.0, atol=1e-12)
    assert np.linalg.norm(np.diff(position, axis=0), axis=1).max() / 0.01 < 2.5 * SPEED_M_S
    assert (turns[1:] * turns[:-1].inv()).magnitude().max() / 0.01 < 2.5 * TURN_RAD_S
    np.testing.assert_allclose(np.diff(position, axis=0)[-90:], 0.0, atol=1e-7)


def test_a_short_way_is_straight(configuration: Configuration) -> None:
    here = place(configuration)
    tip = here.tip + np.array([0.0, 0.9 * NEAR_M, 0.0])
    path = experiment("circle", configuration).path
    whole, way_s = anchored(path, here.tip, here.tip_rotation, tip, here.tip_rotation)
    position, _ = at(whole, np.linspace(0.0, way_s, 200))
    assert np.abs(position[:, [0, 2]]).max() < 1e-12


@pytest.mark.parametrize("name", ["silicon-sine", "silicon-arc", "ring-board"])
def test_from_the_end_of_an_experiment_the_tip_comes_back_past_ball_and_board(
    name: str, configuration: Configuration
) -> None:
    """The board is put there anew meanwhile: the ball lies at the start of its groove."""
    here, one = place(configuration), board(name, configuration)
    path = experiment(name, configuration).path
    starts = [path.duration_s, *experiment(name, configuration).marks[::2]]
    for time_s in starts:
        move, turn = at(path, np.array([time_s]))
        tip, rotation = here.tip + move[0], turn.as_matrix()[0] @ here.tip_rotation
        whole, way_s = anchored(path, here.tip, here.tip_rotation, tip, rotation)
        position, turns = at(whole, np.linspace(0.0, way_s, 300))
        axes = (turns.as_matrix() @ rotation)[:, :, 2]
        # The rounded end; the rest of the instrument leads upward from it.
        ends = tip + position - here.tip_radius * axes
        for solid in one.solids:
            assert distances(solid, ends).min() > here.tip_radius + 3e-4
        if one.ball is not None:
            away = np.linalg.norm(ends - one.ball.position, axis=1)
            assert away.min() > one.ball.radius + here.tip_radius + 3e-4
