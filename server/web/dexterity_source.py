"""Dexterity for the API: loaded when first wanted, asked by one at a time."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import Case

if TYPE_CHECKING:
    from robot.dexterity import Dexterity


class DexteritySource:
    """Measures at any configuration; may be called from any thread.

    Args:
        configuration: of the robot.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._lock = threading.Lock()
        self._dexterity: Dexterity | None = None

    def at(self, x: NDArray[np.float64], case: Case) -> dict[str, Any]:
        """The measures as JSON: see :meth:`robot.dexterity.Dexterity.at`.

        Args:
            x: (10,) configuration.
            case: of priority.
        """
        with self._lock:
            return self._loaded().at(x, case)

    def load(self) -> None:
        """Load the models, so that the first who asks does not wait for them."""
        with self._lock:
            self._loaded()

    def _loaded(self) -> Dexterity:
        if self._dexterity is None:
            from robot.dexterity import Dexterity

            self._dexterity = Dexterity(self._configuration)
        return self._dexterity
