"""The tendons' friction: stuck, beginning to slide, sliding.

A tendon that slides toward the base loses tension toward the tip, one that slides toward the tip
gains it: T_i(s) = tau_i exp(-f_i mu phi(s)), with the backbone's accumulated bend phi. The sliding
share f_i goes from -1 to 1. It follows the tendon's travel as Prandtl's element does, a spring in
series with a slider: where the travel turns, friction first has to be undone and built up again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hardware.rod.properties import RodProperties
from robot.errors import KeyholeError


class TensionRefused(KeyholeError):
    """A tendon can only pull, and by a finite tension.

    Attributes:
        tensions: (4,) as given, N.
    """

    code = "tension_refused"

    def __init__(self, tensions: np.ndarray) -> None:
        written = ", ".join(f"{tension:.4g}" for tension in np.ravel(tensions))
        super().__init__(
            f"the rod's tendons cannot hold [{written}] N: give four finite tensions of 0 or more"
        )
        self.tensions = tensions


class TendonState(NamedTuple):
    """What the tendons remember.

    Attributes:
        sliding: (4,) shares in [-1, 1]; 1 slides toward the base.
        lengths: (4,) changes of length from the straight rod at which these shares held, m.
    """

    sliding: np.ndarray
    lengths: np.ndarray

    def reached(self, lengths: np.ndarray, stick_m: float) -> np.ndarray:
        """(4,) shares after the tendons have moved straight to ``lengths``, not yet limited."""
        return np.asarray(self.sliding - (lengths - self.lengths) / stick_m)


def unmoved() -> TendonState:
    """Tendons of the straight rod that have never slid."""
    return TendonState(np.zeros(4), np.zeros(4))


def checked_tensions(tensions: np.ndarray) -> np.ndarray:
    """(4,) the tensions as numbers.

    Raises:
        TensionRefused: one of them is negative or not finite, or there are not four.
    """
    values = np.array(tensions, dtype=float)
    if values.shape != (4,) or not np.all(np.isfinite(values)) or np.any(values < 0.0):
        raise TensionRefused(values)
    return values


def tensions_along(
    properties: RodProperties, tensions: np.ndarray, sliding: np.ndarray, bends: np.ndarray
) -> np.ndarray:
    """Tensions along the rod.

    Args:
        properties: the rod.
        tensions: (4,) at the base, N.
        sliding: (4,) shares in [-1, 1].
        bends: (n,) accumulated bend from the base, rad.

    Returns:
        (n, 4) N.
    """
    lost = properties.friction * np.outer(bends, sliding)
    return np.asarray(tensions * np.exp(-lost))
