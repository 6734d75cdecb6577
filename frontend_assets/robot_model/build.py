"""Builds the folder that a URDF viewer opens: ``keyhole.urdf``, ``meshes/``, and a stamp."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from pathlib import Path

from robot.configuration import Configuration
from robot.urdf import ARM_MESHES, MODULE_MESHES, SHAFT_MESHES, urdf_text

FOLDER = Path(__file__).parent
MODEL_VERSION = 1
"""Raise this when the code gives other meshes for the same configuration: caches become stale."""
URDF_NAME, MESH_FOLDER, STAMP_NAME = "keyhole.urdf", "meshes", "geometry.sha256"
_MODULE_KEYS = {
    "shaft_base_m",
    "shaft_direction",
    "bend_direction",
    "pulley_radius_m",
    "adapter_size_m",
}
_INSTRUMENT_KEYS = {"shaft_length_m", "shaft_diameter_m"}


def geometry_stamp(configuration: Configuration) -> str:
    """SHA-256 of all that the model depends on; keys that change no shape leave it as it is."""
    module, instrument = configuration.module, configuration.instrument
    shapes = {
        "model": MODEL_VERSION,
        "urdf": urdf_text(configuration, MESH_FOLDER),
        "module": module.model_dump(mode="json", include=_MODULE_KEYS),
        "instrument": instrument.model_dump(mode="json", include=_INSTRUMENT_KEYS),
    }
    return hashlib.sha256(json.dumps(shapes, sort_keys=True).encode()).hexdigest()


def mesh_files(configuration: Configuration) -> dict[str, bytes]:
    """All GLB files by mesh name (without ``.glb``)."""
    # Only a rebuild needs the modelling libraries; finding the committed folder stays quick.
    from frontend_assets.robot_model.arm_links import arm_links
    from frontend_assets.robot_model.glb import glb_bytes, mesh_of
    from frontend_assets.robot_model.instrument_module import instrument_module, shaft

    groups = [
        *zip(ARM_MESHES, arm_links(), strict=True),
        (MODULE_MESHES, instrument_module(configuration.module)),
        (SHAFT_MESHES, shaft(configuration.instrument)),
    ]
    return {
        name: glb_bytes(mesh_of(parts[_material(name)], _material(name)), name)
        for names, parts in groups
        for name in names
    }


def build_model(configuration: Configuration, folder: Path) -> Path:
    """Write URDF, meshes and stamp into ``folder`` (made if missing; the stamp is written last).

    Returns:
        Path of the URDF.
    """
    meshes = folder / MESH_FOLDER
    meshes.mkdir(parents=True, exist_ok=True)
    files = mesh_files(configuration)
    for stale in set(meshes.glob("*.glb")) - {meshes / f"{name}.glb" for name in files}:
        stale.unlink()
    for name, data in files.items():
        (meshes / f"{name}.glb").write_bytes(data)
    (folder / URDF_NAME).write_text(urdf_text(configuration, MESH_FOLDER), encoding="utf-8")
    (folder / STAMP_NAME).write_text(geometry_stamp(configuration) + "\n", encoding="ascii")
    return folder / URDF_NAME


def ensure_model(configuration: Configuration, cache_directory: Path) -> Path:
    """The folder with ``keyhole.urdf`` and ``meshes/`` for this configuration.

    The committed folder serves when the geometry is the one it was built from; otherwise a folder
    in ``cache_directory`` named after the geometry is built once (aside, then moved in place).
    """
    stamp = geometry_stamp(configuration)
    cached = cache_directory / f"robot_model_{stamp[:16]}"
    for folder in (FOLDER, cached):
        if _stamp_in(folder) == stamp:
            return folder
    cache_directory.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(dir=cache_directory, prefix="building_"))
    try:
        build_model(configuration, aside)
        if cached.exists():
            shutil.rmtree(cached)
        aside.rename(cached)
    finally:
        shutil.rmtree(aside, ignore_errors=True)
    return cached


def _stamp_in(folder: Path) -> str | None:
    try:
        return (folder / STAMP_NAME).read_text(encoding="ascii").strip()
    except OSError:
        return None


def _material(name: str) -> str:
    return name.rpartition("_")[2]
