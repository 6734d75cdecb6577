"""The meshes made here."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import viser.transforms as tf

from server.scene.shapes import Mesh, quaternions_from_z, revolve, ring, round_bar
from server.scene.trocar import _port


@pytest.mark.parametrize(
    "mesh",
    [
        ring(0.008, 0.13, -0.003, 0.003, 48),
        round_bar(-0.001, 0.0, 0.0023, 0.0001, 24),
        revolve([(0.0, 0.0), (0.01, 0.0), (0.0, 0.02)], 12, smooth=True),
        _port(0.0023),
    ],
    ids=["ring", "bar", "cone", "port"],
)
def test_shapes_are_closed_and_look_outward(mesh: Mesh) -> None:
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces)
    solid.merge_vertices()
    assert solid.is_watertight
    assert solid.volume > 0.0


def test_quaternions_take_z_onto_directions(rng: np.random.Generator) -> None:
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for direction, wxyz in zip(directions, quaternions_from_z(directions), strict=True):
        assert tf.SO3(wxyz).as_matrix()[:, 2] == pytest.approx(direction)
