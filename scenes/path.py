"""A path: how the tip shall move and turn over time, relative to where it starts."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from robot.compiled import compiled

COLUMNS = 8
"""time_s, x_m, y_m, z_m, qw, qx, qy, qz."""


@compiled
def _evaluate(time_s: float, breaks: np.ndarray, coefficients: np.ndarray, out: np.ndarray) -> None:
    count = breaks.size - 1
    piece = min(max(int(np.searchsorted(breaks, time_s, side="right")) - 1, 0), count - 1)
    s = min(max(time_s, breaks[0]), breaks[-1]) - breaks[piece]
    for k in range(7):
        c = coefficients[:, piece, k]
        out[k] = ((c[0] * s + c[1]) * s + c[2]) * s + c[3]
    norm = np.sqrt(out[3] ** 2 + out[4] ** 2 + out[5] ** 2 + out[6] ** 2)
    for k in range(3, 7):
        out[k] /= norm


class Path:
    """Translation along the base frame's axes from the tip's start, and rotation in the base frame.

    R_desired = R(q) R_start. Between the samples both follow a modified Akima spline: speed has no
    corners, and where samples stand still the path does not swing.

    Attributes:
        name: for people.
        samples: (n, 8) rows of time_s, x_m, y_m, z_m, qw, qx, qy, qz; read-only.
        duration_s: time of the last sample.
    """

    def __init__(self, samples: np.ndarray, name: str) -> None:
        """Make the spline.

        Args:
            samples: (n >= 2, 8), times strictly increasing from 0, quaternions not zero.
            name: for people.
        """
        samples = np.array(samples, dtype=float)
        quaternions = samples[:, 4:8] / np.linalg.norm(samples[:, 4:8], axis=1, keepdims=True)
        turns = np.sign(np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]))
        signs = np.concatenate([[1.0], np.cumprod(np.where(turns == 0.0, 1.0, turns))])
        samples[:, 4:8] = quaternions * signs[:, None]
        samples.flags.writeable = False
        self.name = name
        self.samples = samples
        self.duration_s = float(samples[-1, 0])
        spline = Akima1DInterpolator(samples[:, 0], samples[:, 1:], method="makima")
        self._breaks = np.ascontiguousarray(spline.x)
        self._coefficients = np.ascontiguousarray(spline.c)

    def at(self, time_s: float, out: np.ndarray) -> None:
        """Write translation (m) and unit quaternion at ``time_s`` to ``out`` (7,).

        Before the start and after the end the path stands still.
        """
        _evaluate(time_s, self._breaks, self._coefficients, out)
