"""How experiments share out their time: from rest to rest, because real servos lag."""

from __future__ import annotations

import numpy as np

SAMPLES_PER_SECOND = 100


def times(duration_s: float) -> np.ndarray:
    """Evenly spaced times (n,) from 0 to ``duration_s``."""
    return np.linspace(0.0, duration_s, round(duration_s * SAMPLES_PER_SECOND) + 1)


def still(instants: np.ndarray) -> np.ndarray:
    """Samples (n, 8) of a tip that stays where it is."""
    samples = np.zeros((len(instants), 8))
    samples[:, 0] = instants
    samples[:, 4] = 1.0
    return samples


def minimum_jerk(share: np.ndarray) -> np.ndarray:
    """Way done (0 to 1) at a share of the time (n,), from rest to rest; constant outside."""
    s = np.clip(share, 0.0, 1.0)
    done: np.ndarray = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return done


def cruise(share: np.ndarray, ramp: float) -> np.ndarray:
    """Way done (0 to 1) at a share of the time (n,): rest, an even speed, rest.

    Args:
        share: of the time.
        ramp: share of the time in which the speed grows, and in which it falls, 0 to 0.5.
    """
    s: np.ndarray = np.clip(share, 0.0, 1.0)
    if ramp <= 0.0:
        return s
    # The speed follows minimum_jerk; these are its integrals.
    early, late = np.minimum(s / ramp, 1.0), np.minimum((1.0 - s) / ramp, 1.0)
    gathered = ramp * (early**4 * (2.5 - 3.0 * early + early**2))
    lost = ramp * (0.5 - late**4 * (2.5 - 3.0 * late + late**2))
    even = np.clip(s, ramp, 1.0 - ramp) - ramp
    done: np.ndarray = (gathered + even + np.where(late < 1.0, lost, 0.0)) / (1.0 - ramp)
    return done
