"""The URDF: the same robot in pinocchio, in yourdfpy and in the configuration."""

from __future__ import annotations

import io
import tomllib
from importlib import resources
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from numpy.typing import NDArray

from robot.configuration import Configuration, Module, parse
from robot.urdf import roll_pitch_yaw, shaft_rotation, urdf_text

Array = NDArray[np.float64]

FRAMES = ("link1", "link4", "link7", "flange", "module", "shaft", "segment_base")
TEST_POSES = (
    ((0, 0, 0, 0, 0, 0, 0), (206.0, 0.0, 120.5)),
    ((1.721, -0.938, -5.768, -0.124, 3.937, 2.72, 1.34), (-33.315, 113.614, 411.866)),
    ((2.886, -1.329, 4.564, 2.038, -2.517, 0.351, -5.927), (630.245, 290.462, 354.621)),
)


def table() -> dict[str, Any]:
    return tomllib.loads((resources.files("robot") / "keyhole.toml").read_text("utf-8"))


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return parse(table(), "keyhole.toml")


def pinocchio_poses(text: str, joints: Array) -> dict[str, Array]:
    model = pin.buildModelFromXML(text)
    data = model.createData()
    pin.framesForwardKinematics(model, data, joints)
    return {name: data.oMf[model.getFrameId(name)].homogeneous for name in FRAMES}


@pytest.mark.parametrize(("joints", "position_mm"), TEST_POSES)
def test_last_arm_frame_stands_where_the_maker_says(
    configuration: Configuration, joints: tuple[float, ...], position_mm: tuple[float, ...]
) -> None:
    poses = pinocchio_poses(urdf_text(configuration), np.array(joints, float))
    for frame in ("link7", "flange", "module"):
        np.testing.assert_allclose(1e3 * poses[frame][:3, 3], position_mm, rtol=0, atol=0.01)


def test_both_readers_find_the_same_frames(configuration: Configuration) -> None:
    text = urdf_text(configuration)
    urdf = yourdfpy.URDF.load(io.StringIO(text), load_meshes=False)
    random = np.random.default_rng(7)
    limits = np.array([(j.lower_rad, j.upper_rad) for j in configuration.arm.joints])
    for _ in range(50):
        joints = random.uniform(limits[:, 0], limits[:, 1])
        urdf.update_cfg(joints)
        for name, pose in pinocchio_poses(text, joints).items():
            np.testing.assert_allclose(
                urdf.get_transform(name, "link_base"), pose, rtol=0, atol=1e-12
            )


def test_joint_limits_reach_the_model_exactly(configuration: Configuration) -> None:
    model = pin.buildModelFromXML(urdf_text(configuration))
    joints = configuration.arm.joints
    assert list(model.names[1:]) == [joint.name for joint in joints]
    assert model.lowerPositionLimit.tolist() == [joint.lower_rad for joint in joints]
    assert model.upperPositionLimit.tolist() == [joint.upper_rad for joint in joints]
    assert model.velocityLimit.tolist() == [joint.speed_rad_s for joint in joints]
    assert model.effortLimit.tolist() == [joint.effort_nm for joint in joints]
    assert model.damping.tolist() == [joint.damping_nm_s_rad for joint in joints]


def test_inertials_of_the_moving_links(configuration: Configuration) -> None:
    model = pin.buildModelFromXML(urdf_text(configuration))
    for index, link in enumerate(configuration.arm.links[1:7], start=1):
        inertia = model.inertias[index]
        ixx, ixy, ixz, iyy, iyz, izz = link.inertia_kg_m2
        expected = [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]
        assert inertia.mass == pytest.approx(link.mass_kg, abs=1e-15)
        np.testing.assert_allclose(inertia.lever, link.centre_of_mass_m, rtol=0, atol=1e-15)
        np.testing.assert_allclose(inertia.inertia, expected, rtol=0, atol=1e-15)


def test_last_joint_carries_link_module_and_shaft(configuration: Configuration) -> None:
    model = pin.buildModelFromXML(urdf_text(configuration))
    link, module = configuration.arm.links[7], configuration.module
    instrument = configuration.instrument
    rotation = shaft_rotation(module)
    middle = np.array(module.shaft_base_m) + rotation[:, 2] * instrument.shaft_length_m / 2
    masses = np.array([link.mass_kg, module.mass_kg, instrument.shaft_mass_kg])
    centres = np.array([link.centre_of_mass_m, module.centre_of_mass_m, middle])
    assert model.inertias[7].mass == pytest.approx(masses.sum(), abs=1e-12)
    np.testing.assert_allclose(
        model.inertias[7].lever, masses @ centres / masses.sum(), rtol=0, atol=1e-12
    )
    assert np.linalg.eigvalsh(model.inertias[7].inertia).min() > 0


def test_segment_base_lies_along_the_configured_shaft(configuration: Configuration) -> None:
    poses = pinocchio_poses(urdf_text(configuration), np.zeros(7))
    in_flange = np.linalg.inv(poses["flange"]) @ poses["segment_base"]
    module, length = configuration.module, configuration.instrument.shaft_length_m
    end = np.array(module.shaft_base_m) + length * np.array(module.shaft_direction)
    np.testing.assert_allclose(in_flange[:3, 3], end, rtol=0, atol=1e-12)
    np.testing.assert_allclose(in_flange[:3, 0], module.bend_direction, rtol=0, atol=1e-12)
    np.testing.assert_allclose(in_flange[:3, 2], module.shaft_direction, rtol=0, atol=1e-12)


def test_an_oblique_shaft_needs_no_unit_vectors(configuration: Configuration) -> None:
    changed = table()
    changed["module"] |= {"shaft_direction": [1.0, 2.0, -0.5], "bend_direction": [2.0, -1.0, 0.0]}
    oblique = parse(changed, "oblique.toml")
    poses = pinocchio_poses(urdf_text(oblique), np.zeros(7))
    rotation = (np.linalg.inv(poses["flange"]) @ poses["shaft"])[:3, :3]
    np.testing.assert_allclose(rotation, shaft_rotation(oblique.module), rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=1e-14)
    assert isinstance(oblique.module, Module)
    assert urdf_text(oblique) != urdf_text(configuration)


def test_angles_give_the_rotation_back_also_at_a_quarter_pitch() -> None:
    random = np.random.default_rng(3)
    angles = [tuple(random.uniform(-3, 3, 3)) for _ in range(40)]
    angles += [(roll, sign * np.pi / 2, 0.3) for roll in (-2.0, 0.4) for sign in (-1, 1)]
    for roll, pitch, yaw in angles:
        rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
        back = pin.rpy.rpyToMatrix(*roll_pitch_yaw(rotation))
        np.testing.assert_allclose(back, rotation, rtol=0, atol=1e-14)


def test_mesh_directory_stands_in_every_path(configuration: Configuration) -> None:
    text = urdf_text(configuration, "elsewhere/deep")
    assert text.count("<mesh ") == text.count('filename="elsewhere/deep/')
    assert urdf_text(configuration) == urdf_text(configuration)
