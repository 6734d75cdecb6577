"""Binary glTF files: one mesh, one colour, true normals, the same bytes for the same mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial

from frontend_assets.robot_model.shells import Shell


class Finish(NamedTuple):
    """How a surface looks: linear red, green, blue in 0..1, metallic and roughness in 0..1."""

    colour: tuple[float, float, float]
    metallic: float
    roughness: float


FINISHES = {
    "shell": Finish((0.66, 0.68, 0.75), 0.0, 0.22),
    "dark": Finish((0.035, 0.038, 0.045), 0.0, 0.6),
    "metal": Finish((0.60, 0.61, 0.63), 0.55, 0.32),
    "ivory": Finish((0.84, 0.79, 0.64), 0.0, 0.5),
    "servo": Finish((0.54, 0.56, 0.65), 0.0, 0.4),
}
"""Looks by material name."""


def mesh_of(shell: Shell, material: str) -> trimesh.Trimesh:
    """A mesh in metres from a shell in millimetres, rounded to a micrometre."""
    finish = FINISHES[material]
    visual = trimesh.visual.TextureVisuals(  # type: ignore[no-untyped-call]
        material=PBRMaterial(  # type: ignore[no-untyped-call]
            name=material,
            baseColorFactor=[*finish.colour, 1.0],
            metallicFactor=finish.metallic,
            roughnessFactor=finish.roughness,
        )
    )
    return trimesh.Trimesh(
        vertices=np.round(shell.vertices * 1e-3, 6),
        faces=shell.faces,
        vertex_normals=np.round(shell.normals, 4),
        visual=visual,
        process=False,
    )


def glb_bytes(mesh: trimesh.Trimesh, name: str) -> bytes:
    """The mesh as a GLB file whose geometry is called ``name``."""
    scene = trimesh.Scene()
    scene.add_geometry(mesh, geom_name=name, node_name=name)
    data = scene.export(file_type="glb", include_normals=True)  # type: ignore[no-untyped-call]
    assert isinstance(data, bytes)
    return data
