"""How the shaft stands to the trocar, for whoever asks; control decides for itself."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import Safety
from server.control.trocar import FARTHEST_M, ShaftFinder, ShaftStand
from server.web.refusals import NotInserted, TrocarRefused

FARTHEST_ENTERED_M = 0.05
"""A trocar that is entered must not lie farther from the shaft's axis."""


class TrocarView:
    """Looks at records. Belongs to the event loop.

    Args:
        configuration: of the robot.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._finder: ShaftFinder | None = None

    def load(self) -> None:
        """Load the kinematics, which the first look would wait for."""
        self._found()

    def _found(self) -> ShaftFinder:
        if self._finder is None:
            self._finder = ShaftFinder(self._configuration)
        return self._finder

    def _look(self, record: NDArray[Any]) -> ShaftFinder:
        finder, state = self._found(), record["outcome"]["state"][0]
        finder.find(int(state["safety"]), state["x"], record["input"]["measured_q"][0])
        return finder

    def tip(self, record: NDArray[Any]) -> NDArray[np.float64]:
        """(3,) where the (1,) ``record`` says that the tip is, base frame, m."""
        return self._look(record).tip.copy()

    def stand(self, record: NDArray[Any], trocar: NDArray[np.float64] | None = None) -> ShaftStand:
        """How the shaft stands to ``trocar`` (3,), base frame, m; None for the present one."""
        place = record["input"]["trocar_position"][0] if trocar is None else trocar
        return self._look(record).stand(place)

    def is_inserted(self, stand: ShaftStand) -> bool:
        """Whether the shaft goes through the trocar, so that the robot may be enabled."""
        return self._found().is_inserted(stand)

    def check_inserted(self, record: NDArray[Any]) -> None:
        """Raise :class:`NotInserted` where the shaft does not go through the trocar.

        A robot that is enabled already, or that nothing but a reset helps, is not looked at.
        """
        if record["outcome"]["state"]["safety"][0] not in (Safety.DISABLED, Safety.PAUSED):
            return
        stand = self.stand(record)
        if not self.is_inserted(stand):
            distance_mm = stand.distance_m * 1e3
            limits = self._configuration.limits
            low, high, along = limits.lambda_min, limits.lambda_max, stand.lambda_along_shaft
            raise NotInserted(distance_mm, FARTHEST_M * 1e3, along, low, high)

    def check_entered(self, record: NDArray[Any], trocar: NDArray[np.float64]) -> None:
        """Raise :class:`TrocarRefused` for a place that the shaft cannot be meant to go through."""
        stand = self.stand(record, trocar)
        limits = self._configuration.limits
        along = stand.lambda_along_shaft
        near = stand.distance_m <= FARTHEST_ENTERED_M
        if not (near and limits.lambda_min <= along <= limits.lambda_max):
            distance_mm, farthest_mm = stand.distance_m * 1e3, FARTHEST_ENTERED_M * 1e3
            low, high = limits.lambda_min, limits.lambda_max
            raise TrocarRefused(distance_mm, farthest_mm, along, low, high)
