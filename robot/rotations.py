"""Rotations: exponential, logarithm, quaternions (w, x, y, z).

Everything here is compiled and writes into arrays the caller owns.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled


@compiled
def exponential(vector: np.ndarray, out: np.ndarray) -> None:
    """Rotation matrix of a rotation vector.

    Args:
        vector: (3,) rotation vector in rad.
        out: (3, 3) filled with the rotation matrix.
    """
    x, y, z = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-4:
        a = 1.0 - square / 6.0
        b = 0.5 - square / 24.0
    else:
        a = math.sin(angle) / angle
        b = (1.0 - math.cos(angle)) / square
    out[0, 0] = 1.0 - b * (y * y + z * z)
    out[0, 1] = b * x * y - a * z
    out[0, 2] = b * x * z + a * y
    out[1, 0] = b * x * y + a * z
    out[1, 1] = 1.0 - b * (x * x + z * z)
    out[1, 2] = b * y * z - a * x
    out[2, 0] = b * x * z - a * y
    out[2, 1] = b * y * z + a * x
    out[2, 2] = 1.0 - b * (x * x + y * y)


@compiled
def quaternion_from_matrix(matrix: np.ndarray, out: np.ndarray) -> None:
    """Unit quaternion (w, x, y, z), w >= 0, of a rotation matrix.

    The largest of the four components is computed first, so that no division is by a small number.
    """
    m00, m11, m22 = matrix[0, 0], matrix[1, 1], matrix[2, 2]
    trace = m00 + m11 + m22
    if trace >= max(m00, m11, m22):
        s = 2.0 * math.sqrt(max(1.0 + trace, 0.0))
        w = 0.25 * s
        x = (matrix[2, 1] - matrix[1, 2]) / s
        y = (matrix[0, 2] - matrix[2, 0]) / s
        z = (matrix[1, 0] - matrix[0, 1]) / s
    elif m00 >= m11 and m00 >= m22:
        s = 2.0 * math.sqrt(max(1.0 + m00 - m11 - m22, 0.0))
        w = (matrix[2, 1] - matrix[1, 2]) / s
        x = 0.25 * s
        y = (matrix[0, 1] + matrix[1, 0]) / s
        z = (matrix[0, 2] + matrix[2, 0]) / s
    elif m11 >= m22:
        s = 2.0 * math.sqrt(max(1.0 + m11 - m00 - m22, 0.0))
        w = (matrix[0, 2] - matrix[2, 0]) / s
        x = (matrix[0, 1] + matrix[1, 0]) / s
        y = 0.25 * s
        z = (matrix[1, 2] + matrix[2, 1]) / s
    else:
        s = 2.0 * math.sqrt(max(1.0 + m22 - m00 - m11, 0.0))
        w = (matrix[1, 0] - matrix[0, 1]) / s
        x = (matrix[0, 2] + matrix[2, 0]) / s
        y = (matrix[1, 2] + matrix[2, 1]) / s
        z = 0.25 * s
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if w < 0.0:
        norm = -norm
    out[0] = w / norm
    out[1] = x / norm
    out[2] = y / norm
    out[3] = z / norm


@compiled
def matrix_from_quaternion(wxyz: np.ndarray, out: np.ndarray) -> None:
    """Rotation matrix of a quaternion (w, x, y, z) that need not have unit norm."""
    w, x, y, z = wxyz[0], wxyz[1], wxyz[2], wxyz[3]
    s = 2.0 / (w * w + x * x + y * y + z * z)
    out[0, 0] = 1.0 - s * (y * y + z * z)
    out[0, 1] = s * (x * y - w * z)
    out[0, 2] = s * (x * z + w * y)
    out[1, 0] = s * (x * y + w * z)
    out[1, 1] = 1.0 - s * (x * x + z * z)
    out[1, 2] = s * (y * z - w * x)
    out[2, 0] = s * (x * z - w * y)
    out[2, 1] = s * (y * z + w * x)
    out[2, 2] = 1.0 - s * (x * x + y * y)


@compiled
def logarithm(matrix: np.ndarray, out: np.ndarray) -> float:
    """Rotation vector of a rotation matrix, and its angle.

    Goes through the quaternion, so that it holds near 0 and near pi, where paper eq. (96) divides
    by sin(angle) = 0.

    Args:
        matrix: (3, 3) rotation matrix.
        out: (3,) filled with the rotation vector in rad, norm in [0, pi].

    Returns:
        The angle in rad.
    """
    quaternion = np.empty(4)
    quaternion_from_matrix(matrix, quaternion)
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    sine = math.sqrt(x * x + y * y + z * z)
    angle = 2.0 * math.atan2(sine, w)
    factor = 2.0 if sine < 1e-12 else angle / sine
    out[0] = factor * x
    out[1] = factor * y
    out[2] = factor * z
    return angle


@compiled
def multiply(left: np.ndarray, right: np.ndarray, out: np.ndarray) -> None:
    """``out = left @ right`` for (3, 3) matrices; ``out`` must be neither of them."""
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                left[i, 0] * right[0, j] + left[i, 1] * right[1, j] + left[i, 2] * right[2, j]
            )


@compiled
def multiply_transposed(left: np.ndarray, right: np.ndarray, out: np.ndarray) -> None:
    """``out = left @ right.T`` for (3, 3) matrices; ``out`` must be neither of them."""
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                left[i, 0] * right[j, 0] + left[i, 1] * right[j, 1] + left[i, 2] * right[j, 2]
            )


@compiled
def apply(matrix: np.ndarray, vector: np.ndarray, out: np.ndarray) -> None:
    """``out = matrix @ vector`` for a (3, 3) matrix; ``out`` must not be ``vector``."""
    for i in range(3):
        out[i] = matrix[i, 0] * vector[0] + matrix[i, 1] * vector[1] + matrix[i, 2] * vector[2]


@compiled
def orthonormalize(matrix: np.ndarray) -> None:
    """Take rounding out of a (3, 3) rotation matrix in place, by way of its quaternion."""
    quaternion = np.empty(4)
    quaternion_from_matrix(matrix, quaternion)
    matrix_from_quaternion(quaternion, matrix)


@compiled
def angle_between(left: np.ndarray, right: np.ndarray) -> float:
    """Angle in rad between two (3, 3) rotation matrices."""
    relative = np.empty((3, 3))
    vector = np.empty(3)
    multiply_transposed(left, right, relative)
    return logarithm(relative, vector)
