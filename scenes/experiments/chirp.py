"""The test of a single module: an angle that swings faster and faster, against springs.

Paper 3, section IV-A: 0.052 rad, 0.1 to 10 Hz. The springs' rate is not printed.
"""

from __future__ import annotations

import numpy as np

AMPLITUDE_RAD = 0.052
LOWEST_HZ, HIGHEST_HZ = 0.1, 10.0
DURATION_S = 30.0
SPRING_NM_RAD = 1.0
"""Of the two compression springs together, at the pulley: an assumption."""


def chirp(times: np.ndarray) -> np.ndarray:
    """The angle (n,) in rad at ``times`` (n,) in s: its frequency grows by equal factors."""
    growth = np.log(HIGHEST_HZ / LOWEST_HZ) / DURATION_S
    phase = 2.0 * np.pi * LOWEST_HZ / growth * np.expm1(growth * times)
    return np.asarray(AMPLITUDE_RAD * np.sin(phase))


def frequency(times: np.ndarray) -> np.ndarray:
    """The frequency (n,) in Hz at ``times`` (n,) in s."""
    return np.asarray(LOWEST_HZ * (HIGHEST_HZ / LOWEST_HZ) ** (times / DURATION_S))
