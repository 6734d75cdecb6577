"""Distances from solids are what sampling their surfaces says."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from robot.rotations import matrix_from_quaternion
from robot.segment import tip_position, tip_rotation
from robot.start import start_shaft_rotation
from scenes.boards.clearance import distances, instrument_axis
from scenes.boards.solids import Solid, fixed
from server.configuration_file import load

Kind = Literal["capsule", "sphere", "box", "cylinder"]


def inside(kind: Kind, size: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether points (n, 3) in the solid's frame lie in it, from its definition."""
    radial = np.hypot(points[:, 0], points[:, 1])
    if kind == "box":
        return np.asarray((np.abs(points) <= size).all(axis=1))
    if kind == "cylinder":
        return np.asarray((radial <= size[0]) & (np.abs(points[:, 2]) <= size[1]))
    if kind == "sphere":
        return np.asarray(np.linalg.norm(points, axis=1) <= size[0])
    beyond = np.maximum(np.abs(points[:, 2]) - size[1], 0.0)
    return np.asarray(np.hypot(radial, beyond) <= size[0])


@pytest.mark.parametrize("kind", ["capsule", "sphere", "box", "cylinder"])
def test_distances_agree_with_a_cloud_of_points(kind: Kind, rng: np.random.Generator) -> None:
    size = np.array({"box": [0.7, 0.4, 0.5], "sphere": [0.6, 0, 0]}.get(kind, [0.3, 0.5, 0.0]))
    turn = Rotation.random(random_state=3)
    solid = Solid(
        name="one",
        kind=kind,
        position=fixed([0.1, -0.2, 0.3]),
        wxyz=fixed(turn.as_quat()[[3, 0, 1, 2]]),
        size=fixed(size),
        rgb=(0, 0, 0),
    )
    step = 0.025
    axis = np.arange(-1.0, 1.0 + step, step)
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    within = inside(kind, size, grid)
    points = rng.uniform(-1.2, 1.2, (300, 3))
    found = distances(solid, solid.position + turn.apply(points))
    assert (found[inside(kind, size, points)] <= 1e-12).all()
    assert (found[~inside(kind, size, points)] > 0.0).all()
    from_outside = cKDTree(grid[within]).query(points)[0]
    outside = found > 0.0
    np.testing.assert_allclose(found[outside], from_outside[outside], atol=1.8 * step)
    from_inside = cKDTree(grid[~within]).query(points)[0]
    np.testing.assert_allclose(-found[~outside], from_inside[~outside], atol=1.8 * step)


def test_the_axis_goes_from_the_shaft_to_the_tip_s_rounded_end() -> None:
    configuration = load()
    instrument, rotation = configuration.instrument, start_shaft_rotation(configuration)
    base = np.array([0.1, 0.2, 0.3])
    end = base + instrument.shaft_length_m * rotation[:, 2]
    u, v = 0.8, -0.5
    axis = instrument_axis(instrument, base, end, rotation, np.array([u, v]))
    np.testing.assert_allclose(axis[0], base)
    assert np.linalg.norm(np.diff(axis, axis=0), axis=1).max() < 0.003
    tip, turn = np.empty(3), np.empty((3, 3))
    tip_position(u, v, instrument.segment_length_m, tip)
    tip_rotation(u, v, turn)
    radius = 0.5 * instrument.disk_diameter_m
    rounded = end + rotation @ (tip - radius * turn[:, 2])
    assert np.linalg.norm(axis[-1] - rounded) < 2e-4


def test_quaternions_of_solids_are_wxyz() -> None:
    """A box of 2 x 1 x 1, turned by 90 degrees about z, is long along y."""
    half = np.sqrt(0.5)
    box = Solid(
        "box", "box", fixed(np.zeros(3)), fixed([half, 0, 0, half]), fixed([2, 1, 1]), (0, 0, 0)
    )
    rotation = np.empty((3, 3))
    matrix_from_quaternion(box.wxyz, rotation)
    np.testing.assert_allclose(rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-15)
    found = distances(box, np.array([[0.0, 3.0, 0.0], [3.0, 0.0, 0.0]]))
    np.testing.assert_allclose(found, [1.0, 2.0])
