"""Tensions that bend the rod, and its free bend."""

from __future__ import annotations

import numpy as np

from hardware.rod.properties import RodProperties

PRETENSION = 0.3
QUARTERS = np.radians([0.0, 90.0, 180.0, 270.0])


def pulling(amplitude: float, direction: float, pretension: float = PRETENSION) -> np.ndarray:
    """(4,) N: the tendons on the inside of the bend are pulled, the others stay as they are."""
    return np.asarray(pretension + np.maximum(amplitude * np.cos(direction + QUARTERS), 0.0))


def stiffness_per_rad(properties: RodProperties) -> float:
    """Difference of two opposite tensions per bend when nothing rubs or pushes, N/rad."""
    arm = properties.length_m * properties.pitch_radius_m
    return properties.bending_stiffness_n_m2 / arm
