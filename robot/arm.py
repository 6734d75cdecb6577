"""The arm, computed by pinocchio from the URDF."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from robot.records import ARM_JOINTS


class Arm:
    """Forward kinematics and Jacobian of the seven joints.

    Attributes:
        position: (3,) origin of frame 7 (the flange) in the base frame, m. Updated in place.
        rotation: (3, 3) orientation of frame 7 in the base frame. Updated in place.
        jacobian: (6, 7) rows linear then angular: twist, per joint rate, of the point of frame 7
            that coincides with the base origin, in the base frame. Updated in place.
    """

    def __init__(self, urdf: str) -> None:
        """Read the model.

        Args:
            urdf: the URDF's text; its first seven joints are the arm's.
        """
        self._model = pin.buildModelFromXML(urdf)
        self._data = self._model.createData()
        self._elsewhere = self._model.createData()
        pin.computeJointJacobians(self._model, self._data, np.zeros(ARM_JOINTS))
        placement = self._data.oMi[ARM_JOINTS]
        self.position: np.ndarray = placement.translation
        self.rotation: np.ndarray = placement.rotation
        self.jacobian: np.ndarray = self._data.J

    def place(self, q: np.ndarray, joints: np.ndarray, rotation: np.ndarray) -> None:
        """Where the joints are at ``q``, without touching what :meth:`update` computed.

        Args:
            q: (7,) joint angles, rad.
            joints: (8, 3) filled: the base's origin, then the joints'; the last is the flange.
            rotation: (3, 3) filled: the flange's orientation in the base frame.
        """
        data = self._elsewhere
        pin.forwardKinematics(self._model, data, q)
        for index in range(1, ARM_JOINTS + 1):
            joints[index] = data.oMi[index].translation
        rotation[:] = data.oMi[ARM_JOINTS].rotation

    def update(self, q: np.ndarray) -> None:
        """Compute everything at joint angles ``q`` (7,), rad."""
        pin.computeJointJacobians(self._model, self._data, q)
