"""The model as the viewers take it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import trimesh
import yourdfpy

from frontend_assets.robot_model.build import URDF_NAME
from frontend_assets.robot_model.glb import mesh_of
from frontend_assets.robot_model.instrument_module import segment_disk
from robot.configuration import Instrument


class SmoothMesh(trimesh.Trimesh):
    """A mesh whose copies keep its normals.

    viser's URDF viewer copies every mesh, and trimesh drops normals on copying; without them the
    browser shows round bodies in facets.
    """

    def copy(self, include_cache: bool = True, include_visual: bool = True) -> trimesh.Trimesh:
        """A copy with the same normals."""
        copied = super().copy(include_cache=include_cache, include_visual=include_visual)
        copied._cache.cache["vertex_normals"] = self.vertex_normals.copy()
        return copied


def load_urdf(folder: Path) -> Any:
    """A ``yourdfpy.URDF`` with meshes, for ``viser.extras.ViserUrdf``, which keeps its normals.

    Args:
        folder: what :func:`frontend_assets.robot_model.ensure_model` returned.
    """
    urdf = yourdfpy.URDF.load(str(folder / URDF_NAME), build_scene_graph=True, load_meshes=True)
    for name, mesh in urdf.scene.geometry.items():
        urdf.scene.geometry[name] = SmoothMesh(
            vertices=mesh.vertices,
            faces=mesh.faces,
            vertex_normals=mesh.vertex_normals,
            visual=mesh.visual,
            process=False,
        )
    return urdf


def disk_mesh(instrument: Instrument) -> trimesh.Trimesh:
    """One disk of the continuum segment [m], centred on its axis z, for batched instances.

    Its thickness is 0.45 of the disks' pitch; the tendon holes stand on x, y, -x, -y.
    """
    return mesh_of(segment_disk(instrument), "metal")
