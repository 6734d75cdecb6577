"""Where the robot is, from joint angles and bend: the yardstick for errors.

Keeps its own arm model, apart from the controller's.
"""

from __future__ import annotations

import numpy as np

from robot.arm import Arm
from robot.commands import rotation_error
from robot.compiled import compiled
from robot.instrument import project_on_shaft, shaft, tip
from robot.rotations import matrix_from_quaternion, quaternion_from_matrix


@compiled
def _fill(
    truth: np.ndarray,
    arm_position: np.ndarray,
    arm_rotation: np.ndarray,
    q: np.ndarray,
    u: float,
    v: float,
    parameters: np.ndarray,
) -> None:
    t = truth[0]
    rotation = np.empty((3, 3))
    tip_rotation = np.empty((3, 3))
    shaft(arm_position, arm_rotation, parameters, t.shaft_base, t.shaft_end, rotation)
    tip(t.shaft_end, rotation, u, v, parameters[0].segment_length, t.position, tip_rotation)
    quaternion_from_matrix(tip_rotation, t.wxyz)
    for i in range(7):
        t.q[i] = q[i]
    t.uv[0] = u
    t.uv[1] = v


@compiled
def measure_errors(truth: np.ndarray, position: np.ndarray, wxyz: np.ndarray) -> None:
    """Fill the errors of a (1,) truth record: desired minus it, and the trocar's distance from the
    shaft's axis, perpendicular to it.

    Args:
        truth: (1,) ``TRUTH`` with tip pose, shaft and trocar; its error fields are filled.
        position: (3,) desired tip, base frame, m.
        wxyz: (4,) desired tip orientation.
    """
    t = truth[0]
    square = 0.0
    for i in range(3):
        square += (position[i] - t.position[i]) ** 2
    t.position_error = np.sqrt(square)
    desired = np.empty((3, 3))
    actual = np.empty((3, 3))
    vector = np.empty(3)
    matrix_from_quaternion(wxyz, desired)
    matrix_from_quaternion(t.wxyz, actual)
    t.orientation_error = rotation_error(desired, actual, vector)
    t.lambda_along_shaft, t.rcm_error = project_on_shaft(
        t.trocar_position, t.shaft_base, t.shaft_end
    )


class ForwardKinematics:
    """Tip and shaft of any configuration."""

    def __init__(self, urdf: str, parameters: np.ndarray) -> None:
        self._arm = Arm(urdf)
        self._parameters = parameters

    def fill(self, truth: np.ndarray, q: np.ndarray, u: float, v: float) -> None:
        """Write tip pose, shaft, q and (u, v) into a (1,) ``TRUTH`` record.

        Args:
            truth: (1,) record to fill.
            q: (7,) joint angles, rad.
            u: first segment coordinate, rad.
            v: second segment coordinate, rad.
        """
        self._arm.update(q)
        _fill(truth, self._arm.position, self._arm.rotation, q, u, v, self._parameters)
