"""The trocar as the control loop tells it to the controller: registered, breathing, approached."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot.configuration import Configuration
from robot.forward import ForwardKinematics
from robot.instrument import project_on_shaft
from robot.parameters import parameters
from robot.records import TRUTH, Safety
from robot.urdf import urdf_text
from scenes.trocar_motion import Breathing, TrocarMotion
from server.memory.link_records import TrocarSource

FARTHEST_M = 0.005
"""A trocar farther than this from the shaft's axis keeps the robot from being enabled."""
LAMBDA_SPARE = 0.005
"""Likewise one so far outside the limits of lambda: they would drive the shaft back inside."""

_LEAST_LEAD_M = 1e-4
_LEAST_LEAD_S = 1.0
_LEAD_SPEED_M_S = 0.005


class ShaftStand(NamedTuple):
    """How the shaft stands to a trocar.

    Attributes:
        distance_m: from the trocar to the shaft's axis.
        lambda_along_shaft: where along the shaft that is nearest; 0 at its base, 1 at its end.
        nearest: (3,) that point of the axis, base frame, m.
    """

    distance_m: float
    lambda_along_shaft: float
    nearest: np.ndarray


class ShaftFinder:
    """Where the controller takes the shaft to be at the moment of enabling.

    A disabled robot may have been moved by hand, so that its joints count as they are measured; a
    paused one goes on from where it was commanded.

    Args:
        configuration: of the robot.
    """

    def __init__(self, configuration: Configuration) -> None:
        values = parameters(configuration)
        self._forward = ForwardKinematics(urdf_text(configuration), values)
        self._low, self._high = float(values["lambda_min"][0]), float(values["lambda_max"][0])
        self._found = np.zeros(1, TRUTH)

    def find(self, safety: int, x: np.ndarray, measured_q: np.ndarray) -> None:
        """Look where the shaft is.

        Args:
            safety: the :class:`robot.records.Safety` state.
            x: (10,) commanded configuration.
            measured_q: (7,) measured joint angles, rad.
        """
        q = measured_q if safety == Safety.DISABLED else x[:7]
        self._forward.fill(self._found, np.ascontiguousarray(q), float(x[7]), float(x[8]))

    @property
    def tip(self) -> np.ndarray:
        """(3,) tip, base frame, m, as found last."""
        position: np.ndarray = self._found["position"][0]
        return position

    def stand(self, trocar: np.ndarray) -> ShaftStand:
        """How the shaft that was found last stands to ``trocar`` (3,), base frame, m."""
        base, end = self._found["shaft_base"][0], self._found["shaft_end"][0]
        fraction, distance = project_on_shaft(np.ascontiguousarray(trocar), base, end)
        return ShaftStand(float(distance), float(fraction), base + fraction * (end - base))

    def is_inserted(self, stand: ShaftStand) -> bool:
        """Whether the shaft goes through the trocar, nearly enough to be led there."""
        low, high = self._low - LAMBDA_SPARE, self._high + LAMBDA_SPARE
        return stand.distance_m <= FARTHEST_M and low <= stand.lambda_along_shaft <= high


class LoopTrocar:
    """Where the trocar is, and where the controller is told that it is.

    Both are the same but for the moments after enabling: a shaft that stood a little beside the
    trocar is led there over a second or more instead of at once.

    Attributes:
        registered: (3,) m, base frame, between two breaths.
        source: how it came to be registered.
        motion: how it breathes.
        position: (3,) m, as told for the beginning of the tick.
        velocity: (3,) m/s, as told: the mean over the tick.
        actual: (3,) m, where it is at the end of the tick.
    """

    def __init__(self, configuration: Configuration) -> None:
        trocar = configuration.trocar
        self.registered = np.array(trocar.position_m)
        self.source = TrocarSource.CONFIGURATION
        normal = np.array(trocar.wall_normal)
        self._normal = normal / np.linalg.norm(normal)
        amplitude_m = trocar.breathing_amplitude_mm * 1e-3
        self.motion = TrocarMotion(Breathing(amplitude_m, trocar.breathing_period_s))
        self.position, self.velocity = self.registered.copy(), np.zeros(3)
        self.actual = self.registered.copy()
        self._beside = np.zeros(3)
        self._lead_since_s, self._lead_s = 0.0, 0.0

    def register(self, source: TrocarSource, position: np.ndarray, time_s: float) -> None:
        """Take the trocar to be at ``position`` (3,): touched there now, or resting there."""
        self.registered[:] = position
        if source == TrocarSource.TOUCH:
            self.registered -= self.motion.displacement(time_s) * self._normal
        self.source = source
        self.follow()

    def breathe(self, breathing: Breathing, time_s: float) -> None:
        """Breathe differently with the next breath."""
        self.motion = self.motion.changed(breathing, time_s)

    def at(self, time_s: float) -> np.ndarray:
        """(3,) where the trocar is, base frame, m."""
        place: np.ndarray = self.registered + self.motion.displacement(time_s) * self._normal
        return place

    def lead(self, stand: ShaftStand, time_s: float) -> None:
        """From now on lead the shaft from where it stands to the trocar."""
        self._lead_s = 0.0
        if stand.distance_m > _LEAST_LEAD_M:
            self._beside[:] = stand.nearest - self.at(time_s)
            self._lead_since_s = time_s
            self._lead_s = max(_LEAST_LEAD_S, stand.distance_m / _LEAD_SPEED_M_S)

    def follow(self) -> None:
        """Tell the controller no other place than the actual one."""
        self._lead_s = 0.0

    def look(self, time_s: float, dt_s: float) -> None:
        """Set ``position``, ``velocity`` and ``actual`` for a tick of ``dt_s`` from ``time_s``."""
        self.position[:] = self._told(time_s)
        self.actual[:] = self.at(time_s + dt_s)
        after = self._told(time_s + dt_s) if self._lead_s > 0.0 else self.actual
        self.velocity[:] = (after - self.position) / dt_s

    def _told(self, time_s: float) -> np.ndarray:
        place = self.at(time_s)
        if self._lead_s > 0.0:
            share = (time_s - self._lead_since_s) / self._lead_s
            if share < 1.0:
                left = 1.0 - share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
                place += left * self._beside
        return place
