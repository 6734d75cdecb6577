"""The sensed force axis by axis: how well each is known, and which are not known at all.

A tip pose and four tensions tell little of a force along the tip's axis, and next to nothing of it
where the segment is straight. Along such an axis the estimate only repeats what was expected
beforehand: it is no measurement, and is not shown as one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.sensing.faults import SensingFault

NOT_OBSERVABLE = 0.5
"""An axis along which the standard deviation is still this share of what was expected beforehand,
or more, is not observable: hardly anything was learned along it."""
HELD_S = 2.0
"""An axis that was not observable counts as such for so long: the share is itself estimated, and
picture and numbers must not change with its noise."""


_NUMBERS = ("force", "force_covariance", "modes", "position", "wxyz", "tension")


def fault_of(report: Any) -> SensingFault:
    """What is wrong with the estimate of the instrument's ``report``."""
    fault = SensingFault(int(report["estimate_fault"]))
    # A joint that is measured as no number reaches the estimate through the shaft's pose.
    if all(np.isfinite(report[f"estimate_{name}"]).all() for name in _NUMBERS):
        return fault
    return SensingFault.NOT_CONVERGED if fault == SensingFault.NONE else fault


class ForceAxes(NamedTuple):
    """A force along the axes of its uncertainty, the best known first.

    Attributes:
        directions: (3, 3) unit vectors, one a row, base frame, such that no component is negative.
        components: (3,) of the force, N.
        deviations: (3,) standard deviations, N.
        observable: (3,) whether the axis is.
    """

    directions: NDArray[np.float64]
    components: NDArray[np.float64]
    deviations: NDArray[np.float64]
    observable: NDArray[np.bool_]

    def known(self, count: int) -> tuple[float, float]:
        """Force along the ``count`` best known axes and its standard deviation, N."""
        components, deviations = self.components[:count], self.deviations[:count]
        force = float(np.linalg.norm(components))
        if force < 1e-9:
            return 0.0, float(deviations.max(initial=0.0))
        return force, float(np.linalg.norm(components * deviations)) / force


def force_axes(
    force: NDArray[np.float64], covariance: NDArray[np.float64], expected: float
) -> ForceAxes:
    """Axes of a (3,) ``force`` with its (3, 3) ``covariance``, N and N^2.

    ``expected``: standard deviation of the forces that were expected beforehand, N.
    """
    variances, vectors = np.linalg.eigh(covariance)
    deviations = np.sqrt(np.maximum(variances, 0.0))
    directions = vectors.T
    components = directions @ force
    signs = np.where(components < 0.0, -1.0, 1.0)
    return ForceAxes(
        directions * signs[:, None],
        components * signs,
        deviations,
        deviations < NOT_OBSERVABLE * expected,
    )


class KnownAxes:
    """How many axes count as observable, held against noise for :data:`HELD_S`."""

    def __init__(self) -> None:
        self._count, self._until = 3, -np.inf

    def count(self, now: float, axes: ForceAxes) -> int:
        """How many of the best known ``axes`` count as observable at ``now`` (s)."""
        observable = int(axes.observable.sum())
        # A replay's clock may run back.
        holds = self._until - HELD_S <= now < self._until
        if observable <= self._count or not holds:
            self._count, self._until = observable, now + HELD_S
        return self._count
