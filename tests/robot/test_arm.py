"""The arm: its maker's poses, its DH table, its Jacobian."""

from __future__ import annotations

import numpy as np
import pytest

from robot.arm import Arm
from tests import own_kinematics
from tests.robot.differences import twist_columns

POSES_MM = (
    ((0, 0, 0, 0, 0, 0, 0), (206.0, 0.0, 120.5)),
    ((1.721, -0.938, -5.768, -0.124, 3.937, 2.72, 1.34), (-33.315, 113.614, 411.866)),
    ((2.886, -1.329, 4.564, 2.038, -2.517, 0.351, -5.927), (630.245, 290.462, 354.621)),
)


def random_joints(parameters: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(rng.uniform(parameters[0]["joint_lower"], parameters[0]["joint_upper"]))


@pytest.mark.parametrize(("joints", "position_mm"), POSES_MM)
def test_the_maker_s_poses(
    arm: Arm, joints: tuple[float, ...], position_mm: tuple[float, ...]
) -> None:
    arm.update(np.array(joints, float))
    np.testing.assert_allclose(1e3 * arm.position, position_mm, rtol=0, atol=0.01)
    np.testing.assert_allclose(
        1e3 * own_kinematics.flange(np.array(joints, float))[:3, 3], position_mm, rtol=0, atol=0.01
    )


def test_frame_7_is_the_modified_dh_table_s(
    arm: Arm, parameters: np.ndarray, rng: np.random.Generator
) -> None:
    for _ in range(50):
        q = random_joints(parameters, rng)
        arm.update(q)
        expected = own_kinematics.flange(q)
        np.testing.assert_allclose(arm.position, expected[:3, 3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(arm.rotation, expected[:3, :3], rtol=0, atol=1e-12)


def test_jacobian_is_the_derivative(
    arm: Arm, parameters: np.ndarray, rng: np.random.Generator
) -> None:
    def pose(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        transform = own_kinematics.flange(q)
        return transform[:3, 3], transform[:3, :3]

    for _ in range(20):
        q = random_joints(parameters, rng)
        arm.update(q)
        at_flange = arm.jacobian.copy()
        at_flange[:3] += np.cross(arm.jacobian[3:].T, arm.position).T
        np.testing.assert_allclose(at_flange, twist_columns(pose, q), rtol=0, atol=1e-9)


def test_update_renews_what_was_handed_out(
    arm: Arm, parameters: np.ndarray, rng: np.random.Generator
) -> None:
    position, rotation, jacobian = arm.position, arm.rotation, arm.jacobian
    arm.update(random_joints(parameters, rng))
    before = position.copy()
    q = random_joints(parameters, rng)
    arm.update(q)
    assert np.linalg.norm(position - before) > 1e-3
    np.testing.assert_array_equal(position, arm.position)
    np.testing.assert_array_equal(rotation, arm.rotation)
    np.testing.assert_array_equal(jacobian, arm.jacobian)
    np.testing.assert_allclose(position, own_kinematics.flange(q)[:3, 3], rtol=0, atol=1e-12)
