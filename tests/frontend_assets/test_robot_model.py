"""The robot's meshes: true to the outlines, closed, smooth, and the same on every build."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from frontend_assets.robot_model import build, ensure_model
from frontend_assets.robot_model.glb import glb_bytes, mesh_of
from frontend_assets.robot_model.instrument_module import instrument_module, shaft
from frontend_assets.robot_model.viewing import disk_mesh, load_urdf
from robot.configuration import Configuration, parse
from robot.urdf import ARM_MESHES, MODULE_MESHES, SHAFT_MESHES, urdf_text

Array = NDArray[np.float64]

OUTLINES_MM = (
    ((-92, -63, 0), (63, 63, 155)),
    ((-48, -57, -112), (48, 75, 48)),
    ((-48, -192, -42), (47, 47, 119)),
    ((-42, -67, -101), (95, 69, 43)),
    ((-43, -169, -42), (120, 43, 107)),
    ((-42, -43, -173), (42, 86, 37)),
    ((-37, -38, -37), (113, 69, 58)),
    ((-37, -52, -28), (37, 37, 0)),
)
ALL_MESHES = tuple(name for names in (*ARM_MESHES, MODULE_MESHES, SHAFT_MESHES) for name in names)


def table() -> dict[str, Any]:
    return tomllib.loads((resources.files("robot") / "keyhole.toml").read_text("utf-8"))


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return parse(table(), "keyhole.toml")


@pytest.fixture(scope="module")
def rebuilt(configuration: Configuration) -> dict[str, bytes]:
    return build.mesh_files(configuration)


@pytest.fixture(scope="module")
def other() -> Configuration:
    """Another shaft, on another side of the same arm."""
    changed = table()
    changed["instrument"]["shaft_length_m"] = 0.180
    changed["module"] |= {"shaft_base_m": [0.0, 0.05, 0.120], "shaft_direction": [0.0, 1.0, 0.0]}
    return parse(changed, "other.toml")


@pytest.fixture(scope="module")
def cached(other: Configuration, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the model of the other geometry was built, alone in its cache."""
    return ensure_model(other, tmp_path_factory.mktemp("models"))


def mesh(name: str, folder: Path = build.FOLDER) -> trimesh.Trimesh:
    scene = trimesh.load(folder / "meshes" / f"{name}.glb", process=False)
    assert isinstance(scene, trimesh.Scene)
    (only,) = scene.geometry.values()
    assert isinstance(only, trimesh.Trimesh)
    return only


def welded(shell: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(shell.vertices, shell.faces, process=True)


def test_committed_urdf_is_what_the_configuration_gives(configuration: Configuration) -> None:
    committed = (build.FOLDER / build.URDF_NAME).read_text("utf-8")
    assert committed == urdf_text(configuration)
    stamp = (build.FOLDER / build.STAMP_NAME).read_text("ascii").strip()
    assert stamp == build.geometry_stamp(configuration)


def test_committed_meshes_are_what_the_code_gives(
    rebuilt: dict[str, bytes], tmp_path: Path
) -> None:
    assert sorted(rebuilt) == sorted(ALL_MESHES)
    assert {path.stem for path in (build.FOLDER / "meshes").iterdir()} == set(ALL_MESHES)
    (tmp_path / "meshes").mkdir()
    for name, data in rebuilt.items():
        (tmp_path / "meshes" / f"{name}.glb").write_bytes(data)
        fresh, committed = mesh(name, tmp_path), mesh(name)
        np.testing.assert_array_equal(fresh.faces, committed.faces, err_msg=name)
        np.testing.assert_allclose(fresh.vertices, committed.vertices, rtol=0, atol=2e-6)


def test_a_second_build_gives_the_same_bytes(
    configuration: Configuration, rebuilt: dict[str, bytes], cached: Path
) -> None:
    """The links depend on no configuration: building the other geometry has built them again."""
    links = [name for names in ARM_MESHES for name in names]
    again = {name: (cached / "meshes" / f"{name}.glb").read_bytes() for name in links}
    for names, parts in (
        (MODULE_MESHES, instrument_module(configuration.module)),
        (SHAFT_MESHES, shaft(configuration.instrument)),
    ):
        for name in names:
            material = name.rpartition("_")[2]
            again[name] = glb_bytes(mesh_of(parts[material], material), name)
    assert again == rebuilt


@pytest.mark.parametrize("index", range(8))
def test_arm_links_fill_their_outlines(index: int) -> None:
    vertices = 1e3 * np.vstack([mesh(name).vertices for name in ARM_MESHES[index]])
    low, high = OUTLINES_MM[index]
    np.testing.assert_allclose(vertices.min(axis=0), low, rtol=0, atol=3.0)
    np.testing.assert_allclose(vertices.max(axis=0), high, rtol=0, atol=3.0)


@pytest.mark.parametrize("name", ALL_MESHES)
def test_meshes_are_closed_with_outward_normals(name: str) -> None:
    shell = mesh(name)
    solid = welded(shell)
    assert solid.is_watertight
    assert solid.volume > 0
    assert np.linalg.norm(shell.vertex_normals, axis=1) == pytest.approx(1, abs=1e-3)
    corner = np.einsum("fcj,fj->fc", shell.vertex_normals[shell.faces], shell.face_normals)
    wide = shell.area_faces > 1e-8
    assert corner[wide].min() > 0.3


def test_light_enough_for_a_software_renderer() -> None:
    assert sum(len(mesh(name).faces) for name in ALL_MESHES) < 60_000
    assert sum(path.stat().st_size for path in (build.FOLDER / "meshes").iterdir()) < 3e6


def test_shaft_is_as_long_and_thick_as_configured(configuration: Configuration) -> None:
    low, high = mesh("shaft_metal").bounds
    instrument = configuration.instrument
    np.testing.assert_allclose(high[2] - low[2], instrument.shaft_length_m, rtol=0, atol=1e-6)
    np.testing.assert_allclose(high[0] - low[0], instrument.shaft_diameter_m, rtol=0, atol=1e-6)


def test_disk_has_its_bore_and_four_holes(configuration: Configuration) -> None:
    disk, instrument = disk_mesh(configuration.instrument), configuration.instrument
    solid = welded(disk)
    assert solid.is_watertight
    assert solid.euler_number == 2 - 2 * 5
    thickness = np.ptp(disk.vertices[:, 2])
    assert np.ptp(disk.vertices[:, 0]) == pytest.approx(instrument.disk_diameter_m, abs=2e-6)
    assert thickness < instrument.segment_length_m / instrument.disk_count
    assert len(disk.faces) < 1000


def test_viewer_keeps_the_normals() -> None:
    urdf = load_urdf(build.FOLDER)
    assert set(urdf.scene.geometry) == {f"{name}.glb" for name in ALL_MESHES}
    for file, shown in urdf.scene.geometry.items():
        copied = shown.copy()
        copied.apply_scale(1.0)
        copied.apply_transform(np.eye(4))
        np.testing.assert_allclose(
            copied.vertex_normals, mesh(Path(file).stem).vertex_normals, atol=1e-3
        )
        sent = copied.export(file_type="glb")
        assert isinstance(sent, bytes)
        assert b'"NORMAL"' in sent


def test_default_geometry_needs_no_build(configuration: Configuration, tmp_path: Path) -> None:
    changed = table()
    changed["module"]["servo_speed_deg_s"] = 90.0
    changed["start"]["bend_deg"] = 10.0
    for same in (configuration, parse(changed, "changed.toml")):
        assert ensure_model(same, tmp_path) == build.FOLDER
    assert not list(tmp_path.iterdir())


def test_other_geometry_is_built_once_into_the_cache(other: Configuration, cached: Path) -> None:
    assert (cached / build.URDF_NAME).read_text("utf-8") == urdf_text(other)
    written = (cached / build.STAMP_NAME).stat().st_mtime_ns
    assert ensure_model(other, cached.parent) == cached
    assert (cached / build.STAMP_NAME).stat().st_mtime_ns == written
    assert [path.name for path in cached.parent.iterdir()] == [cached.name]
    assert mesh("shaft_metal", cached).bounds[1][2] == pytest.approx(0.180, abs=1e-6)
